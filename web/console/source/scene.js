// SPDX-License-Identifier: Apache-2.0
// 3-D view: team, ghost at the desired values, environment.

import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

import { colour } from "./palette.js";

const BODY = "#b9925a";
const UP = new THREE.Vector3(0, 0, 1);

function material(robot, ghost) {
  return new THREE.MeshLambertMaterial({
    color: robot < 0 ? BODY : colour(robot),
    ...(ghost && {
      transparent: true,
      opacity: 0.28,
      depthWrite: false,
      // Draw the robot in front of a ghost at the same pose.
      polygonOffset: true,
      polygonOffsetFactor: 2,
      polygonOffsetUnits: 2,
    }),
  });
}

// Decode meshes; console/frames.py defines the format.
function readMeshes(data) {
  const view = new DataView(data);
  const meshes = [];
  for (let at = 4; at < data.byteLength; ) {
    const count = 3 * view.getUint32(at, true);
    const geometry = new THREE.BufferGeometry();
    const corners = new Float32Array(data, at + 4, count);
    const normals = new Int8Array(data, at + 4 + 4 * count, count);
    geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3, true));
    meshes.push(geometry);
    at += 4 + 4 * count + 4 * Math.ceil(count / 4);
  }
  return meshes;
}

function place(object, poses, at) {
  object.visible = Number.isFinite(poses[at]);
  if (!object.visible) return;
  object.position.fromArray(poses, at);
  object.quaternion.fromArray(poses, at + 3);
}

export class Scene {
  constructor(parent) {
    this.parent = parent;
    this.renderer = new THREE.WebGLRenderer({ antialias: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio || 1, 2));
    parent.append(this.renderer.domElement);
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color("#dfe6ee");
    this.camera = new THREE.PerspectiveCamera(45, 1, 0.02, 200);
    this.camera.up.copy(UP);
    this.camera.position.set(0, -2, 2);
    this.orbit = new OrbitControls(this.camera, this.renderer.domElement);
    this.orbit.addEventListener("change", () => this.redraw());
    this.scene.add(new THREE.HemisphereLight("#ffffff", "#8a8f98", 2.0));
    const sun = new THREE.DirectionalLight("#ffffff", 1.7);
    sun.position.set(1.5, -2, 3);
    this.scene.add(sun);
    const grid = new THREE.GridHelper(6, 24, "#8d98a5", "#bcc6d1");
    grid.rotation.x = Math.PI / 2;
    this.scene.add(grid, new THREE.AxesHelper(0.25));
    this.group = new THREE.Group();
    this.scene.add(this.group);
    this.handles = new Map();
    this.dirty = true;
    this.drawn = 0;
    new ResizeObserver(() => this.resize()).observe(parent);
    this.resize();
    const loop = () => {
      requestAnimationFrame(loop);
      if (!this.dirty) return;
      this.dirty = false;
      this.drawn += 1;
      this.renderer.render(this.scene, this.camera);
    };
    loop();
  }

  redraw() {
    this.dirty = true;
  }

  resize() {
    const [width, height] = [this.parent.clientWidth, this.parent.clientHeight];
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.redraw();
  }

  build(hello, data) {
    this.group.clear();
    this.hello = hello;
    this.fitted = false;
    const meshes = readMeshes(data);
    const groups = (count) => Array.from({ length: count }, () => new THREE.Group());
    const world = new THREE.Group();
    [this.joints, this.ghosts] = [groups(hello.joints), groups(hello.joints)];
    this.bodies = groups(hello.bodies);
    this.ghost = new THREE.Group();
    const parents = [world, ...this.joints, ...this.bodies];
    for (const { joint, robot } of hello.shapes) {
      const geometry = meshes.shift();
      parents[joint].add(new THREE.Mesh(geometry, material(robot, false)));
      const ghost = this.ghosts[joint - 1];
      if (ghost) ghost.add(new THREE.Mesh(geometry, material(robot, true)));
    }
    if (hello.joints) this.ghost.add(...this.ghosts);
    this.group.add(...parents, this.ghost);
    this.buildWalls(hello);
    this.buildHandles(hello);
    this.buildEdges(hello);
    this.redraw();
  }

  buildWalls({ walls }) {
    for (const { point, normal } of walls) {
      const wall = new THREE.Mesh(
        new THREE.PlaneGeometry(2, 1),
        new THREE.MeshLambertMaterial({
          color: "#8b94a0",
          transparent: true,
          opacity: 0.6,
          side: THREE.DoubleSide,
        }),
      );
      const direction = new THREE.Vector3(...normal).normalize();
      const up = Math.abs(direction.z) > 0.9 ? new THREE.Vector3(0, 1, 0) : UP;
      wall.up.copy(up);
      wall.position.set(...point);
      wall.lookAt(direction.add(wall.position));
      this.group.add(wall);
    }
  }

  buildHandles({ subtasks }) {
    this.handles.clear();
    for (const { name, handles } of subtasks) {
      for (const { element } of handles) this.handles.set(`${name}/${element}`, new THREE.Group());
    }
  }

  buildEdges({ edges, robots }) {
    this.tools = robots.map(() => new THREE.Group());
    const positions = new THREE.BufferAttribute(new Float32Array(6 * edges.length), 3);
    const geometry = new THREE.BufferGeometry().setAttribute("position", positions);
    const lineMaterial = new THREE.LineBasicMaterial({ color: "#5c6673" });
    this.edges = new THREE.LineSegments(geometry, lineMaterial);
    this.edges.frustumCulled = false;
    this.group.add(this.edges);
  }

  // Draw a frame of poses; console/frames.py defines the format. Returns its time [s], or null.
  update(data) {
    const view = new DataView(data);
    if (!this.hello || (data.byteLength - 16) / 28 !== view.getUint32(4, true)) return null;
    const poses = new Float32Array(data, 16);
    let at = 0;
    const placeAll = (objects) => {
      for (const object of objects) {
        place(object, poses, at);
        at += 7;
      }
    };
    placeAll(this.joints);
    placeAll(this.ghosts);
    placeAll(this.bodies);
    placeAll(this.handles.values());
    placeAll(this.tools);
    const line = this.edges.geometry.attributes.position;
    this.hello.edges.flat().forEach((tool, corner) => {
      line.setXYZ(corner, ...this.tools[tool].position.toArray());
    });
    line.needsUpdate = true;
    if (!this.fitted) this.fitCamera();
    this.redraw();
    return view.getFloat64(8, true);
  }

  // Fit the camera to the team: from the front and above, +x to the right.
  fitCamera() {
    const box = new THREE.Box3();
    this.group.updateMatrixWorld(true);
    for (const object of [...this.joints, ...this.tools, ...this.bodies]) {
      if (object.visible) box.expandByObject(object);
    }
    if (box.isEmpty()) return;
    const ball = box.getBoundingSphere(new THREE.Sphere());
    const angle = Math.atan(Math.tan((this.camera.fov * Math.PI) / 360) * Math.min(1, this.camera.aspect));
    const distance = (1.15 * Math.max(0.4, ball.radius)) / Math.sin(angle);
    this.orbit.target.copy(ball.center);
    this.camera.position.set(0, -0.75, 0.66).multiplyScalar(distance).add(ball.center);
    this.orbit.update();
    this.fitted = true;
  }

  showGhosts(shown) {
    if (this.ghost) this.ghost.visible = shown;
    this.redraw();
  }

  // Window coordinates of a point in the world [px].
  toWindow(point) {
    const projected = point.clone().project(this.camera);
    const box = this.renderer.domElement.getBoundingClientRect();
    return [box.x + ((projected.x + 1) / 2) * box.width, box.y + ((1 - projected.y) / 2) * box.height];
  }
}
