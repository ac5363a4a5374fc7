// SPDX-License-Identifier: Apache-2.0
// Handle of the driven subtask: displacement since the grab while it is dragged or rotated.

import * as THREE from "three";
import { TransformControls } from "three/examples/jsm/controls/TransformControls.js";

export class Handle {
  constructor(scene) {
    this.scene = scene;
    this.object = new THREE.Group();
    scene.scene.add(this.object);
    this.controls = new TransformControls(scene.camera, scene.renderer.domElement);
    this.controls.setSpace("world");
    this.controls.setSize(0.9);
    scene.scene.add(this.controls.getHelper());
    this.start = { position: new THREE.Vector3(), quaternion: new THREE.Quaternion() };
    this.dragging = false;
    this.grab = 1; // Odd numbers; pads and keys use even ones.
    this.controls.addEventListener("change", () => scene.redraw());
    this.controls.addEventListener("dragging-changed", ({ value }) => {
      scene.orbit.enabled = !value;
      this.dragging = value;
      if (!value) return;
      this.grab += 2;
      this.start.position.copy(this.object.position);
      this.start.quaternion.copy(this.object.quaternion);
    });
  }

  // Attach to a handle described by the greeting; null hides it.
  show(name, handle) {
    const key = handle && `${name}/${handle.element}`;
    if (key === this.key) return;
    this.release();
    [this.key, this.description] = [key, handle];
    if (!handle) {
      this.controls.detach();
    } else {
      for (const axis of ["x", "y", "z"]) {
        this.controls[`show${axis.toUpperCase()}`] =
          this.controls.mode === "rotate" || handle.axes.includes(axis);
      }
      this.follow();
      this.controls.attach(this.object);
    }
    this.scene.redraw();
  }

  setMode(mode) {
    this.controls.setMode(mode);
    const { key, description } = this;
    if (!description) return;
    this.key = null;
    this.show(key.slice(0, key.lastIndexOf("/")), description);
  }

  // Follow the team while not dragged.
  follow() {
    const target = this.scene.handles.get(this.key);
    if (this.dragging || !target) return;
    this.object.position.copy(target.position);
    this.object.quaternion.copy(target.quaternion);
  }

  release() {
    if (!this.dragging) return;
    // Same as a release of the pointer.
    this.controls.pointerUp({ button: 0 });
    this.dragging = false;
    this.scene.orbit.enabled = true;
  }

  held() {
    if (!this.dragging) return null;
    const translation = this.object.position.clone().sub(this.start.position);
    const inverse = this.start.quaternion.clone().invert();
    const rotation = this.object.quaternion.clone().multiply(inverse).normalize();
    return {
      grab: this.grab,
      translation: translation.toArray(),
      rotation: rotation.toArray(),
    };
  }

  // Length in the world of a share of the handle's size [m].
  worldLength(share) {
    const distance = this.object.position.distanceTo(this.scene.camera.position);
    const view = 1.9 * Math.tan((Math.PI * this.scene.camera.fov) / 360);
    return (share * distance * Math.min(view, 7) * this.controls.size) / 4;
  }

  // Window coordinates of an axis' arrow [px].
  arrow(axis) {
    const offset = new THREE.Vector3();
    offset[axis] = this.worldLength(0.32);
    return this.scene.toWindow(this.object.position.clone().add(offset));
  }

  // Window coordinates of an axis' ring [px]: on the near side, away from other rings.
  ring(axis) {
    const direction = new THREE.Vector3();
    direction[axis] = 1.0;
    const offset = this.scene.camera.position.clone().sub(this.object.position);
    offset[axis] = 0.0;
    offset.setLength(this.worldLength(0.5)).applyAxisAngle(direction, 0.7);
    return this.scene.toWindow(this.object.position.clone().add(offset));
  }
}
