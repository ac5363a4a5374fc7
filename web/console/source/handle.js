// SPDX-License-Identifier: Apache-2.0
// The handle on what is driven: pulled or turned, it tells how far it is from where it was taken.

import * as THREE from "three";
import { TransformControls } from "three/examples/jsm/controls/TransformControls.js";

export class Handle {
  constructor(scene) {
    this.scene = scene;
    this.place = new THREE.Group();
    scene.scene.add(this.place);
    this.controls = new TransformControls(scene.camera, scene.renderer.domElement);
    this.controls.setSpace("world");
    this.controls.setSize(0.9);
    scene.scene.add(this.controls.getHelper());
    this.start = { position: new THREE.Vector3(), quaternion: new THREE.Quaternion() };
    this.dragging = false;
    this.grab = 1; // Odd numbers; pads and keys have even ones.
    this.controls.addEventListener("change", () => scene.redraw());
    this.controls.addEventListener("dragging-changed", ({ value }) => {
      scene.orbit.enabled = !value;
      this.dragging = value;
      if (!value) return;
      this.grab += 2;
      this.start.position.copy(this.place.position);
      this.start.quaternion.copy(this.place.quaternion);
    });
  }

  // What it belongs to: a handle as the greeting describes it; null hides it.
  show(name, handle) {
    const key = handle && `${name}/${handle.element}`;
    if (key === this.key) return;
    this.release();
    [this.key, this.what] = [key, handle];
    if (!handle) {
      this.controls.detach();
    } else {
      for (const axis of ["x", "y", "z"]) {
        this.controls[`show${axis.toUpperCase()}`] =
          this.controls.mode === "rotate" || handle.axes.includes(axis);
      }
      this.follow();
      this.controls.attach(this.place);
    }
    this.scene.redraw();
  }

  setMode(mode) {
    this.controls.setMode(mode);
    const { key, what } = this;
    if (!what) return;
    this.key = null;
    this.show(key.slice(0, key.lastIndexOf("/")), what);
  }

  // Keeps to the team while nobody pulls.
  follow() {
    const target = this.scene.handles.get(this.key);
    if (this.dragging || !target) return;
    this.place.position.copy(target.position);
    this.place.quaternion.copy(target.quaternion);
  }

  release() {
    if (!this.dragging) return;
    // As if the pointer had let go.
    this.controls.pointerUp({ button: 0 });
    this.dragging = false;
    this.scene.orbit.enabled = true;
  }

  held() {
    if (!this.dragging) return null;
    const by = this.place.position.clone().sub(this.start.position);
    const back = this.start.quaternion.clone().invert();
    const turn = this.place.quaternion.clone().multiply(back).normalize();
    return { grab: this.grab, by: by.toArray(), turn: turn.toArray() };
  }

  // Length in the world of so much of the handle [m].
  reach(share) {
    const distance = this.place.position.distanceTo(this.scene.camera.position);
    const wide = 1.9 * Math.tan((Math.PI * this.scene.camera.fov) / 360);
    return (share * distance * Math.min(wide, 7) * this.controls.size) / 4;
  }

  // Where the arrow of an axis can be taken hold of, in the window [px].
  arrow(axis) {
    const offset = new THREE.Vector3();
    offset[axis] = this.reach(0.32);
    return this.scene.inWindow(this.place.position.clone().add(offset));
  }

  // The same of the ring about an axis: on the near side, away from where it crosses another one.
  ring(axis) {
    const about = new THREE.Vector3();
    about[axis] = 1.0;
    const offset = this.scene.camera.position.clone().sub(this.place.position);
    offset[axis] = 0.0;
    offset.setLength(this.reach(0.5)).applyAxisAngle(about, 0.7);
    return this.scene.inWindow(this.place.position.clone().add(offset));
  }
}
