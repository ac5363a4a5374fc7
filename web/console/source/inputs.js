// SPDX-License-Identifier: Apache-2.0
// Inputs that an operator holds: pads, keys, gamepad. All are released when the page loses focus.

const DEADZONE = 0.12;
const ENABLE_BUTTONS = [4, 5]; // Shoulder buttons of the standard mapping; one must be held.
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

const clamp = (value) => Math.max(-1, Math.min(1, value));
const withDeadzone = (value) => (Math.abs(value) < DEADZONE ? 0 : clamp(value));

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
    const radius = 0.36 * box.width;
    const x = (event.clientX - box.left - box.width / 2) / radius;
    const y = -(event.clientY - box.top - box.height / 2) / radius;
    const size = Math.max(1, Math.hypot(x, y));
    this.value = [x / size, y / size];
    this.show(radius);
  }

  show(radius) {
    const [x, y] = this.value;
    this.knob.style.transform = `translate(${x * radius}px, ${-y * radius}px)`;
  }

  release() {
    this.pointer = null;
    this.value = [0, 0];
    this.show(0);
  }
}

const isTextField = (target) => target.closest?.("input:not([type=checkbox]), select, textarea") != null;

export class Inputs {
  constructor(plane, height) {
    this.plane = new Pad(plane);
    this.height = new Pad(height);
    this.keys = new Set();
    this.grab = 0;
    this.lastDevice = null;
    addEventListener("keydown", (event) => {
      if (!(event.code in KEYS) || isTextField(event.target)) return;
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

  // Normalized twist; null while nothing is held.
  held() {
    const linear = [0, 0, 0];
    const angular = [0, 0, 0];
    const twist = { linear, angular };
    let device = null;
    if (this.plane.held || this.height.held) {
      device = "pad";
      [linear[0], linear[1]] = this.plane.value;
      linear[2] = this.height.value[1];
      angular[2] = -this.height.value[0];
    } else if (this.keys.size) {
      device = "keys";
      for (const code of this.keys) {
        const [kind, axis, sign] = KEYS[code];
        twist[kind][axis] += sign;
      }
    } else {
      const pad = [...(navigator.getGamepads?.() ?? [])].find(
        (one) => one?.connected && ENABLE_BUTTONS.some((button) => one.buttons[button]?.pressed),
      );
      if (pad) {
        device = "gamepad";
        const [x = 0, y = 0, yaw = 0, z = 0] = pad.axes;
        [linear[0], linear[1], linear[2]] = [withDeadzone(x), -withDeadzone(y), -withDeadzone(z)];
        angular[2] = -withDeadzone(yaw);
      }
    }
    if (device && device !== this.lastDevice) this.grab += 2;
    this.lastDevice = device;
    if (!device) return null;
    const { grab } = this;
    return { device, grab, linear: linear.map(clamp), angular: angular.map(clamp) };
  }
}
