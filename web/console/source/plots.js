// SPDX-License-Identifier: Apache-2.0
// Small plots of the last seconds, on plain canvases.

import { colour } from "./palette.js";

const SPAN = 20; // [s]
const MARGIN = 44; // [px] for numbers

const short = (value) =>
  value === 0 ? "0" : Math.abs(value) >= 1e4 || Math.abs(value) < 1e-3
    ? value.toExponential(0)
    : String(Number(value.toPrecision(2)));

// A name has the same colour in every plot.
const names = [];

function colourOf(name) {
  const whose = name.split(" ")[0];
  if (!names.includes(whose)) names.push(whose);
  return colour(names.indexOf(whose) + name.endsWith("σ"));
}

class Plot {
  constructor(parent, title, floor) {
    this.box = document.createElement("div");
    this.box.className = "plot";
    this.box.innerHTML = "<h3></h3><canvas></canvas><p></p>";
    this.box.querySelector("h3").textContent = title;
    this.canvas = this.box.querySelector("canvas");
    this.words = this.box.querySelector("p");
    this.floor = floor;
    this.series = new Map();
    parent.append(this.box);
  }

  add(time, name, value) {
    if (!this.series.has(name)) this.series.set(name, []);
    const points = this.series.get(name);
    // After a reset of the team's time the past has no place.
    if (points.length && time < points[points.length - 1][0]) points.length = 0;
    points.push([time, value]);
    while (points[0][0] < time - SPAN) points.shift();
  }

  draw() {
    const ratio = devicePixelRatio || 1;
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!width) return;
    if (this.canvas.width !== Math.round(width * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    const pen = this.canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    const all = [...this.series.values()].flat();
    if (!all.length) return;
    const end = Math.max(...all.map(([time]) => time));
    let low = Math.min(0, ...all.map(([, value]) => value));
    let high = Math.max(this.floor, ...all.map(([, value]) => value));
    const room = 0.06 * (high - low);
    [low, high] = [low < 0 ? low - room : 0, high + room];
    const x = (time) => MARGIN + ((time - end) / SPAN + 1) * (width - MARGIN - 2);
    const y = (value) => height - 4 - ((value - low) / (high - low)) * (height - 10);
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const value of new Set([low < 0 ? low + room : 0, 0, high - room])) {
      pen.strokeStyle = "#d5dce4";
      pen.beginPath();
      pen.moveTo(MARGIN, y(value));
      pen.lineTo(width, y(value));
      pen.stroke();
      pen.fillStyle = "#57616e";
      pen.fillText(short(value), MARGIN - 4, Math.max(6, Math.min(height - 6, y(value))));
    }
    this.words.replaceChildren();
    for (const [name, points] of this.series) {
      pen.strokeStyle = colourOf(name);
      pen.lineWidth = 1.5;
      pen.beginPath();
      for (const [time, value] of points) pen.lineTo(x(time), y(value));
      pen.stroke();
      const word = document.createElement("span");
      word.style.color = colourOf(name);
      word.textContent = `${name} ${points[points.length - 1][1].toPrecision(3)}`;
      this.words.append(word);
    }
  }
}

export class Plots {
  constructor(parent) {
    this.parent = parent;
    this.plots = {};
    this.dirty = false;
    setInterval(() => this.draw(), 100);
  }

  plot(key, title, floor) {
    this.plots[key] ??= new Plot(this.parent, title, floor);
    return this.plots[key];
  }

  clear() {
    this.parent.replaceChildren();
    this.plots = {};
  }

  take({ time, errors, angles, energy }) {
    this.dirty = true;
    for (const [name, value] of Object.entries(errors)) {
      this.plot("error", "Tracking error [m]", 1e-4).add(time, name, value);
    }
    for (const [name, value] of Object.entries(angles)) {
      this.plot("angle", "Tracking error [rad]", 1e-4).add(time, name, value);
    }
    for (const [name, account] of Object.entries(energy)) {
      const whose = name || "team";
      const add = (key, label, plot, title, floor) => {
        if (key in account) this.plot(plot, title, floor).add(time, label, account[key]);
      };
      add("storage", whose, "storage", "Storage [J]", 1e-4);
      add("supplied", whose, "power", "Power supplied [W]", 1e-4);
      add("tank", `${whose} tank [J]`, "tank", "Tank [J] and σ", 1);
      add("sigma", `${whose} σ`, "tank", "Tank [J] and σ", 1);
    }
  }

  draw() {
    if (!this.dirty || document.hidden) return;
    this.dirty = false;
    for (const plot of Object.values(this.plots)) plot.draw();
  }
}
