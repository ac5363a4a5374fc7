// SPDX-License-Identifier: Apache-2.0
// Page of operator_console: connects view, inputs, panel and plots to the server.

import { Connection } from "./connection.js";
import { Handle } from "./handle.js";
import { Inputs } from "./inputs.js";
import { Panel } from "./panel.js";
import { Plots } from "./plots.js";
import { Scene } from "./scene.js";

const INPUT_PERIOD = 25; // [ms] between messages of a held input
const HEARTBEAT_DIVISOR = 3; // Heartbeat once in so many input periods.
const INPUT_TIMEOUT = 1000; // [ms]
const MESHES = 1;

const find = (id) => document.getElementById(id);

const scene = new Scene(find("canvas"));
const handle = new Handle(scene);
const inputs = new Inputs(find("pad-plane"), find("pad-height"));
const plots = new Plots(find("plots"));
const state = { hello: null, status: null, page: null, frames: 0, held: null, heldSince: 0 };
const connection = new Connection({ onText, onBytes, onClose });
const send = (message) => connection.send(message);
const panel = new Panel(send);

function onText(message) {
  if (message.kind === "hello") {
    state.hello = message;
    panel.build(message);
    plots.clear();
    listHandles();
  } else if (message.kind === "welcome") {
    state.page = message.page;
  } else if (message.kind === "status") {
    state.status = message;
    showStatus();
  } else if (message.kind === "sample") {
    plots.update(message);
  } else if (message.kind === "response") {
    panel.notify(message.ok, message.text);
  }
}

function onBytes(data) {
  if (new DataView(data).getUint32(0, true) === MESHES) {
    scene.build(state.hello, data);
    scene.showGhosts(find("ghosts").checked);
    return;
  }
  if (scene.update(data) === null) return;
  state.frames += 1;
  handle.follow();
}

function onClose(text) {
  Object.assign(state, { status: null, page: null });
  find("connection").textContent = text;
  find("connection").dataset.state = "bad";
  find("driver").textContent = "not driving; reconnecting";
  find("control").disabled = true;
  inputs.release();
  update();
}

const drives = () => state.page !== null && state.status?.driver === state.page;

function listHandles() {
  const { subtasks, drivable } = state.hello;
  const options = subtasks
    .filter(({ name }) => drivable.includes(name))
    .flatMap(({ name, handles }) =>
      handles.map(({ element, label }) => {
        const text = label === name ? name : `${name}: ${label}`;
        return new Option(text, `${name}/${element}`);
      }),
    );
  const before = find("driven").value;
  find("driven").replaceChildren(...options);
  if (options.some(({ value }) => value === before)) find("driven").value = before;
  chooseMode();
}

function selected() {
  const [name, element] = find("driven").value.split("/");
  const found = state.hello?.subtasks.find((subtask) => subtask.name === name);
  return { name, handle: found?.handles[Number(element)] };
}

// Reason why the selected subtask cannot be driven now; empty if it can.
function blockedReason() {
  const { status, hello } = state;
  if (!status) return "not connected";
  if (status.stopped) return "stopped: inputs have no effect until a driver resumes";
  if (!drives()) return status.driver === null ? "take control to drive" : "another page drives";
  if (!status.live) return status.paused ? "paused" : "no joint states received";
  const { name, handle } = selected();
  if (!handle) {
    const awaited = hello.awaited.join(", ");
    return awaited
      ? `lockstep waits for another source of ${awaited}; see the key lockstep_sources`
      : "no subtask can be driven";
  }
  const { authority } = status.subtasks[name];
  if (authority !== "human") return `${name}: authority is ${authority}; set it to human first`;
  return "";
}

// True if the server has released an input that is still held here, after a long stutter.
const inputTimedOut = () =>
  state.held && !state.status?.held && performance.now() - state.heldSince > INPUT_TIMEOUT;

function showStatus() {
  const { status } = state;
  const driving = drives();
  const [text, kind] = status.stopped
    ? ["STOPPED", "bad"]
    : !status.live
      ? [status.paused ? "paused" : "no joint states", "warn"]
      : ["live", "good"];
  find("connection").textContent = text;
  find("connection").dataset.state = kind;
  const pages = `${status.pages} ${status.pages === 1 ? "page" : "pages"} open`;
  const driver = driving
    ? "you drive"
    : status.driver === null
      ? "no driver"
      : "another page drives";
  find("driver").textContent = `${driver}, ${pages}`;
  find("control").disabled = false;
  find("control").textContent = driving
    ? "Release control"
    : status.driver === null
      ? "Take control"
      : "Take over";
  find("control").classList.toggle("driving", driving);
  find("stop").classList.toggle("stopped", status.stopped);
  find("resume").hidden = !status.stopped;
  find("resume").disabled = !driving;
  panel.update(status, driving);
  update();
}

function update() {
  const reason = blockedReason();
  const { name, handle: target } = state.hello ? selected() : {};
  handle.show(name, reason ? null : target);
  find("hint").textContent =
    reason || (inputTimedOut() ? "input timed out: release it and grab again" : "");
  for (const pad of document.querySelectorAll(".pad")) pad.classList.toggle("enabled", !reason);
  find("pad-height").hidden = Boolean(target) && !target.axes.includes("z") && !target.rotates;
}

function chooseMode() {
  const { handle: target } = selected();
  find("rotate").hidden = !target?.rotates;
  const rotating = Boolean(target?.rotates) && find("rotate").getAttribute("aria-pressed") === "true";
  handle.setMode(rotating ? "rotate" : "translate");
  update();
}

// Send the held input periodically: silence releases it. A frozen page has no timers.
let period = 0;
setInterval(() => {
  const twist = inputs.held();
  const drag = handle.held();
  period = (period + 1) % HEARTBEAT_DIVISOR;
  if ((twist || drag) && !blockedReason()) {
    const { name, handle: target } = selected();
    const driven = { subtask: name, element: target.element };
    if (drag) send({ kind: "drag", ...driven, ...drag });
    else send({ kind: "twist", ...driven, ...twist, device: undefined });
    if (!state.held) state.heldSince = performance.now();
    state.held = drag ? "handle" : twist.device;
  } else if (state.held) {
    send({ kind: "release" });
    state.held = null;
  } else if (period === 0 && state.page !== null) {
    send({ kind: "heartbeat" });
  }
}, INPUT_PERIOD);

function stop() {
  inputs.release();
  handle.release();
  send({ kind: "stop" });
}

find("stop").onpointerdown = stop;
find("stop").onclick = (event) => event.detail === 0 && stop(); // By Enter or a screen reader.
addEventListener(
  "keydown",
  (event) => {
    if (event.code !== "Space") return;
    // Regardless of the focus, and before a focused button handles it as a click.
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) stop();
  },
  { capture: true },
);
addEventListener("keyup", (event) => event.code === "Space" && event.preventDefault(), {
  capture: true,
});
addEventListener("blur", () => handle.release());
document.addEventListener("visibilitychange", () => document.hidden && handle.release());
find("resume").onclick = () => send({ kind: "resume" });
find("control").onclick = () => send({ kind: drives() ? "release_control" : "take_control" });
find("driven").onchange = chooseMode;
find("rotate").onclick = ({ currentTarget: button }) => {
  button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
  chooseMode();
};
find("ghosts").onchange = ({ target }) => scene.showGhosts(target.checked);

let last = { drawn: 0, frames: 0 };
setInterval(() => {
  const now = { drawn: scene.drawn, frames: state.frames };
  const drawn = now.drawn - last.drawn;
  find("rate").textContent = `${drawn} of ${now.frames - last.frames} frames/s`;
  document.body.dataset.frames = String(drawn);
  last = now;
}, 1000);

// Interface for tests and benchmarks.
globalThis.operatorConsole = {
  arrow: (axis) => handle.arrow(axis),
  ring: (axis) => handle.ring(axis),
  handle: () => handle.object.position.toArray(),
  rotation: () => handle.object.quaternion.toArray(),
  pixel: (point) => scene.toWindow(scene.camera.position.clone().fromArray(point)),
  status: () => state.status,
  drives,
};
