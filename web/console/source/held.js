// SPDX-License-Identifier: Apache-2.0
// Everything that a person can hold: pads, keys, a gamepad. All is let go when the page is left.

const DEADZONE = 0.12;
const SHOULDERS = [4, 5]; // Buttons of the standard mapping, either of which must be held.
const KEYS = {
  ArrowRight: ["linear", 0, 1],
  ArrowLeft: ["linear", 0, -1],
  ArrowUp: ["linear", 1, 1],
  ArrowDown: ["linear", 1, -1],
  KeyD: ["linear", 0, 1],
  KeyA: ["linear", 0, -1],
  KeyW: ["linear", 1, 1],
  KeyS: ["linear", 1, -1],
  KeyR: ["linear", 2, 1],
  KeyF: ["linear", 2, -1],
  KeyJ: ["angular", 2, 1],
  KeyL: ["angular", 2, -1],
  KeyI: ["angular", 0, 1],
  KeyK: ["angular", 0, -1],
  KeyU: ["angular", 1, 1],
  KeyO: ["angular", 1, -1],
};

const within = (value) => Math.max(-1, Math.min(1, value));
const live = (value) => (Math.abs(value) < DEADZONE ? 0 : within(value));

class Pad {
  constructor(element) {
    this.element = element;
    this.knob = element.querySelector("i");
    this.pointer = null;
    this.value = [0, 0];
    element.onpointerdown = (event) => {
      this.pointer = event.pointerId;
      element.setPointerCapture(event.pointerId);
      this.move(event);
    };
    element.onpointermove = (event) => event.pointerId === this.pointer && this.move(event);
    element.onpointerup = element.onpointercancel = element.onlostpointercapture = () =>
      this.release();
  }

  get held() {
    return this.pointer !== null;
  }

  move(event) {
    const box = this.element.getBoundingClientRect();
    const reach = 0.36 * box.width;
    const x = (event.clientX - box.left - box.width / 2) / reach;
    const y = -(event.clientY - box.top - box.height / 2) / reach;
    const size = Math.max(1, Math.hypot(x, y));
    this.value = [x / size, y / size];
    this.show(reach);
  }

  show(reach) {
    const [x, y] = this.value;
    this.knob.style.transform = `translate(${x * reach}px, ${-y * reach}px)`;
  }

  release() {
    this.pointer = null;
    this.value = [0, 0];
    this.show(0);
  }
}

const typing = (target) => target.closest?.("input:not([type=checkbox]), select, textarea") != null;

export class Inputs {
  constructor(plane, height) {
    this.plane = new Pad(plane);
    this.height = new Pad(height);
    this.keys = new Set();
    this.grab = 0;
    this.before = null;
    addEventListener("keydown", (event) => {
      if (!(event.code in KEYS) || typing(event.target)) return;
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      this.keys.add(event.code);
    });
    addEventListener("keyup", (event) => this.keys.delete(event.code));
    addEventListener("blur", () => this.release());
    document.addEventListener("visibilitychange", () => document.hidden && this.release());
  }

  release() {
    this.plane.release();
    this.height.release();
    this.keys.clear();
  }

  // Shares of the largest rates; null while nothing is held.
  held() {
    const linear = [0, 0, 0];
    const angular = [0, 0, 0];
    const rates = { linear, angular };
    let by = null;
    if (this.plane.held || this.height.held) {
      by = "pad";
      [linear[0], linear[1]] = this.plane.value;
      linear[2] = this.height.value[1];
      angular[2] = -this.height.value[0];
    } else if (this.keys.size) {
      by = "keys";
      for (const code of this.keys) {
        const [kind, axis, sign] = KEYS[code];
        rates[kind][axis] += sign;
      }
    } else {
      const pad = [...(navigator.getGamepads?.() ?? [])].find(
        (one) => one?.connected && SHOULDERS.some((button) => one.buttons[button]?.pressed),
      );
      if (pad) {
        by = "gamepad";
        const [x = 0, y = 0, turn = 0, z = 0] = pad.axes;
        [linear[0], linear[1], linear[2]] = [live(x), -live(y), -live(z)];
        angular[2] = -live(turn);
      }
    }
    if (by && by !== this.before) this.grab += 2;
    this.before = by;
    return by && { by, grab: this.grab, linear: linear.map(within), angular: angular.map(within) };
  }
}
