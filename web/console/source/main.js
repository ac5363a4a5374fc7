// SPDX-License-Identifier: Apache-2.0
// The page of operator_console: puts its parts together.

import { Handle } from "./handle.js";
import { Inputs } from "./held.js";
import { Link } from "./link.js";
import { Panel } from "./panel.js";
import { Plots } from "./plots.js";
import { Scene } from "./scene.js";

const HOLD_PERIOD = 25; // [ms] at which what is held is said again
const BEATS = 3; // One in so many periods says that the page is alive.
const LAPSE = 1000; // [ms]
const MESHES = 1;

const find = (id) => document.getElementById(id);

const scene = new Scene(find("canvas"));
const handle = new Handle(scene);
const inputs = new Inputs(find("pad-plane"), find("pad-height"));
const plots = new Plots(find("plots"));
const state = { hello: null, status: null, me: null, pictures: 0, held: null, since: 0 };
const link = new Link({ onText, onBytes, onState });
const send = (message) => link.send(message);
const panel = new Panel(send);

function onText(message) {
  if (message.kind === "hello") {
    state.hello = message;
    panel.build(message);
    plots.clear();
    listHandles();
  } else if (message.kind === "you") {
    state.me = message.page;
  } else if (message.kind === "status") {
    state.status = message;
    showStatus();
  } else if (message.kind === "sample") {
    plots.take(message);
  } else if (message.kind === "answer") {
    panel.say(message.ok, message.text);
  }
}

function onBytes(data) {
  if (new DataView(data).getUint32(0, true) === MESHES) {
    scene.build(state.hello, data);
    scene.showGhosts(find("ghosts").checked);
    return;
  }
  if (scene.take(data) === null) return;
  state.pictures += 1;
  handle.follow();
}

function onState(text) {
  Object.assign(state, { status: null, me: null });
  find("connection").textContent = text;
  find("connection").dataset.state = "bad";
  find("driver").textContent = "nothing is driven; connecting again";
  find("take").disabled = true;
  inputs.release();
  update();
}

const drives = () => state.me !== null && state.status?.driver === state.me;

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
  const before = find("what").value;
  find("what").replaceChildren(...options);
  if (options.some(({ value }) => value === before)) find("what").value = before;
  chooseMode();
}

function chosen() {
  const [name, element] = find("what").value.split("/");
  const found = state.hello?.subtasks.find((subtask) => subtask.name === name);
  return { name, handle: found?.handles[Number(element)] };
}

// Why what is chosen cannot be driven now, in words; an empty text, where it can.
function obstacle() {
  const { status, hello } = state;
  if (!status) return "not connected";
  if (status.stopped) return "stopped: everything you do has no effect until somebody resumes";
  if (!drives()) return status.driver === null ? "take control to drive" : "somebody else drives";
  if (!status.there) return status.paused ? "paused" : "the team is not there";
  const { name, handle } = chosen();
  if (!handle) {
    const awaited = hello.awaited.join(", ");
    return awaited
      ? `the scenario waits for another source of ${awaited}: see its key lockstep_sources`
      : "nothing here can be driven";
  }
  const { authority } = status.subtasks[name];
  if (authority !== "human") return `${name} is led by ${authority}: hand it over to human first`;
  return "";
}

// The program lets go of what a page was silent about for long, though a hand still holds it.
const lapsed = () =>
  state.held && !state.status?.held && performance.now() - state.since > LAPSE;

function showStatus() {
  const { status } = state;
  const mine = drives();
  const [text, kind] = status.stopped
    ? ["STOPPED", "bad"]
    : !status.there
      ? [status.paused ? "paused" : "no states of the team", "warn"]
      : ["live", "good"];
  find("connection").textContent = text;
  find("connection").dataset.state = kind;
  const others = `${status.pages} ${status.pages === 1 ? "page" : "pages"} open`;
  const who = mine ? "you drive" : status.driver === null ? "nobody drives" : "somebody else drives";
  find("driver").textContent = `${who}, ${others}`;
  find("take").disabled = false;
  find("take").textContent = mine
    ? "Leave control"
    : status.driver === null
      ? "Take control"
      : "Take over";
  find("take").classList.toggle("mine", mine);
  find("stop").classList.toggle("stopped", status.stopped);
  find("resume").hidden = !status.stopped;
  find("resume").disabled = !mine;
  panel.take(status, mine);
  update();
}

function update() {
  const reason = obstacle();
  const { name, handle: wanted } = state.hello ? chosen() : {};
  handle.show(name, reason ? null : wanted);
  find("hint").textContent =
    reason || (lapsed() ? "not held any more: let go and take hold again" : "");
  for (const pad of document.querySelectorAll(".pad")) pad.classList.toggle("able", !reason);
  find("pad-height").hidden = Boolean(wanted) && !wanted.axes.includes("z") && !wanted.rotates;
}

function chooseMode() {
  const { handle: wanted } = chosen();
  find("turn").hidden = !wanted?.rotates;
  const turning = Boolean(wanted?.rotates) && find("turn").getAttribute("aria-pressed") === "true";
  handle.setMode(turning ? "rotate" : "translate");
  update();
}

// Says what is held, again and again: silence lets go. Runs by a timer, which a frozen page has not.
let beat = 0;
setInterval(() => {
  const pushed = inputs.held();
  const pulled = handle.held();
  beat = (beat + 1) % BEATS;
  if ((pushed || pulled) && !obstacle()) {
    const { name, handle: what } = chosen();
    const to = { subtask: name, element: what.element };
    if (pulled) send({ kind: "drag", ...to, ...pulled });
    else send({ kind: "push", ...to, ...pushed, by: undefined });
    if (!state.held) state.since = performance.now();
    state.held = pulled ? "handle" : pushed.by;
  } else if (state.held) {
    send({ kind: "release" });
    state.held = null;
  } else if (beat === 0 && state.me !== null) {
    send({ kind: "beat" });
  }
}, HOLD_PERIOD);

function stop() {
  inputs.release();
  handle.release();
  send({ kind: "stop" });
}

find("stop").onpointerdown = stop;
find("stop").onclick = (event) => event.detail === 0 && stop(); // By Enter, or a screen reader.
addEventListener(
  "keydown",
  (event) => {
    if (event.code !== "Space") return;
    // Wherever the cursor is, and before any button takes it for a click.
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
find("take").onclick = () => send({ kind: drives() ? "leave" : "take" });
find("what").onchange = chooseMode;
find("turn").onclick = ({ currentTarget: button }) => {
  button.setAttribute("aria-pressed", String(button.getAttribute("aria-pressed") !== "true"));
  chooseMode();
};
find("ghosts").onchange = ({ target }) => scene.showGhosts(target.checked);

let before = { drawn: 0, pictures: 0 };
setInterval(() => {
  const now = { drawn: scene.drawn, pictures: state.pictures };
  const drawn = now.drawn - before.drawn;
  find("rate").textContent = `${drawn} frames/s of ${now.pictures - before.pictures}`;
  document.body.dataset.frames = String(drawn);
  before = now;
}, 1000);

// For tests and measurements: where to take hold of things.
globalThis.operatorConsole = {
  arrow: (axis) => handle.arrow(axis),
  ring: (axis) => handle.ring(axis),
  handle: () => handle.place.position.toArray(),
  turn: () => handle.place.quaternion.toArray(),
  pixel: (point) => scene.inWindow(scene.camera.position.clone().fromArray(point)),
  status: () => state.status,
  drives,
};
