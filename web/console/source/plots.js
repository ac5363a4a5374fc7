// SPDX-License-Identifier: Apache-2.0
// Plots of the last seconds on 2-D canvases.

import { colour } from "./palette.js";

const SPAN = 20; // [s]
const MARGIN = 44; // [px] for tick labels

const formatTick = (value) =>
  value === 0 ? "0" : Math.abs(value) >= 1e4 || Math.abs(value) < 1e-3
    ? value.toExponential(0)
    : String(Number(value.toPrecision(2)));

// A subtask has the same colour in every plot.
const names = [];

function colourOf(name) {
  const owner = name.split(" ")[0];
  if (!names.includes(owner)) names.push(owner);
  return colour(names.indexOf(owner) + name.endsWith("σ"));
}

class Plot {
  constructor(parent, title, minRange) {
    this.box = document.createElement("div");
    this.box.className = "plot";
    this.box.innerHTML = "<h3></h3><canvas></canvas><p></p>";
    this.box.querySelector("h3").textContent = title;
    this.canvas = this.box.querySelector("canvas");
    this.legend = this.box.querySelector("p");
    this.minRange = minRange;
    this.series = new Map();
    parent.append(this.box);
  }

  add(time, name, value) {
    if (!this.series.has(name)) this.series.set(name, []);
    const points = this.series.get(name);
    // Clear the series when the team's time was reset.
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
    let high = Math.max(this.minRange, ...all.map(([, value]) => value));
    const padding = 0.06 * (high - low);
    [low, high] = [low < 0 ? low - padding : 0, high + padding];
    const x = (time) => MARGIN + ((time - end) / SPAN + 1) * (width - MARGIN - 2);
    const y = (value) => height - 4 - ((value - low) / (high - low)) * (height - 10);
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const value of new Set([low < 0 ? low + padding : 0, 0, high - padding])) {
      pen.strokeStyle = "#d5dce4";
      pen.beginPath();
      pen.moveTo(MARGIN, y(value));
      pen.lineTo(width, y(value));
      pen.stroke();
      pen.fillStyle = "#57616e";
      pen.fillText(formatTick(value), MARGIN - 4, Math.max(6, Math.min(height - 6, y(value))));
    }
    this.legend.replaceChildren();
    for (const [name, points] of this.series) {
      pen.strokeStyle = colourOf(name);
      pen.lineWidth = 1.5;
      pen.beginPath();
      for (const [time, value] of points) pen.lineTo(x(time), y(value));
      pen.stroke();
      const entry = document.createElement("span");
      entry.style.color = colourOf(name);
      entry.textContent = `${name} ${points[points.length - 1][1].toPrecision(3)}`;
      this.legend.append(entry);
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

  plot(key, title, minRange) {
    this.plots[key] ??= new Plot(this.parent, title, minRange);
    return this.plots[key];
  }

  clear() {
    this.parent.replaceChildren();
    this.plots = {};
  }

  update({ time, errors, angles, energy }) {
    this.dirty = true;
    for (const [name, value] of Object.entries(errors)) {
      this.plot("error", "Tracking error [m]", 1e-4).add(time, name, value);
    }
    for (const [name, value] of Object.entries(angles)) {
      this.plot("angle", "Tracking error [rad]", 1e-4).add(time, name, value);
    }
    for (const [name, values] of Object.entries(energy)) {
      const owner = name || "team";
      const add = (key, label, plot, title, minRange) => {
        if (key in values) this.plot(plot, title, minRange).add(time, label, values[key]);
      };
      add("storage", owner, "storage", "Storage [J]", 1e-4);
      add("supplied", owner, "power", "Power supplied [W]", 1e-4);
      add("tank", `${owner} tank [J]`, "tank", "Tank [J] and σ", 1);
      add("sigma", `${owner} σ`, "tank", "Tank [J] and σ", 1);
    }
  }

  draw() {
    if (!this.dirty || document.hidden) return;
    this.dirty = false;
    for (const plot of Object.values(this.plots)) plot.draw();
  }
}
