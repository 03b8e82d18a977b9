// What is around the vehicles: walls, obstacles, fence, planned trajectories, frames, and the goal.

import { THREE } from "nicegui-scene";
import { label } from "./vehicles.js";

const SHAPES = {
  box: () => new THREE.BoxGeometry(),
  cylinder: () => new THREE.CylinderGeometry(0.5, 0.5, 1, 32).rotateX(Math.PI / 2),
  ball: () => new THREE.SphereGeometry(0.5, 32, 16),
};

// Take all out of a group, with what the graphics card holds of it.
function empty(group) {
  for (const child of group.children) child.geometry?.dispose();
  group.clear();
}

export class Surroundings extends THREE.Group {
  constructor() {
    super();
    this.world = new THREE.Group();
    this.paths = new THREE.Group();
    this.frames = new Map();
    this.add(this.world, this.paths);
  }

  // Replace walls, obstacles and fences; a solid is [shape, position, rotation, size, color, opacity].
  setWorld(solids, fences) {
    empty(this.world);
    for (const [shape, position, rotation, size, color, opacity] of solids) {
      const solid = new THREE.Mesh(SHAPES[shape](), new THREE.MeshLambertMaterial(
        { color, opacity, transparent: opacity < 1, depthWrite: opacity >= 1 }));
      solid.position.set(...position);
      solid.quaternion.set(...rotation);
      solid.scale.set(...size);
      this.world.add(solid);
    }
    for (const fence of fences) {
      const box = new THREE.Box3(...fence.map((corner) => new THREE.Vector3(...corner)));
      this.world.add(new THREE.Box3Helper(box, "#e0a030"));
    }
  }

  // Replace the planned trajectories: lists of points.
  setPaths(paths) {
    empty(this.paths);
    for (const path of paths) {
      const points = path.map((point) => new THREE.Vector3(...point));
      this.paths.add(new THREE.Line(new THREE.BufferGeometry().setFromPoints(points),
        new THREE.LineBasicMaterial({ color: "#b58cff" })));
    }
  }

  // Show the frames that are no vehicles: each name, x, y, z, quaternion x, y, z, w.
  setFrames(frames) {
    const present = new Set(frames.map(([name]) => name));
    for (const [name, axes] of this.frames) {
      if (present.has(name)) continue;
      axes.children[0].removeFromParent();  // Its element leaves the document only so.
      axes.removeFromParent();
      this.frames.delete(name);
    }
    for (const [name, ...pose] of frames) {
      if (!this.frames.has(name)) {
        const axes = new THREE.AxesHelper(0.12);
        axes.add(label(name, "tag frame"));
        this.frames.set(name, axes);
        this.add(axes);
      }
      this.frames.get(name).position.set(...pose.slice(0, 3));
      this.frames.get(name).quaternion.set(...pose.slice(3));
    }
  }
}

// Where a go to leads: a handle at its height, a stem to the floor, an arrow for the heading.
export class Goal extends THREE.Group {
  constructor() {
    super();
    const look = { color: "#ffc857" };
    // What is there when the goal is reached is seen through it.
    this.handle = new THREE.Mesh(new THREE.SphereGeometry(0.07, 20, 12), new THREE.MeshLambertMaterial(
      { ...look, transparent: true, opacity: 0.4, depthWrite: false }));
    this.stem = new THREE.Mesh(new THREE.CylinderGeometry(0.006, 0.006, 1, 8).rotateX(Math.PI / 2),
      new THREE.MeshBasicMaterial(look));
    this.foot = new THREE.Mesh(new THREE.RingGeometry(0.07, 0.085, 32), new THREE.MeshBasicMaterial(look));
    this.arrow = new THREE.ArrowHelper(new THREE.Vector3(1, 0, 0), new THREE.Vector3(), 0.3, look.color);
    this.add(this.handle, this.stem, this.foot, this.arrow);
    this.visible = false;
  }

  // Show a goal { x, y, z, yaw }, yaw in rad or null; nothing for null.
  show(goal) {
    this.visible = goal !== null;
    if (!goal) return;
    this.height = goal.z;
    this.position.set(goal.x, goal.y, 0);
    this.handle.position.z = this.arrow.position.z = goal.z;
    this.stem.scale.z = Math.max(0.001, goal.z);
    this.stem.position.z = goal.z / 2;
    this.foot.position.z = 0.004;
    this.arrow.visible = goal.yaw !== null;
    if (goal.yaw !== null) this.arrow.setDirection(new THREE.Vector3(Math.cos(goal.yaw), Math.sin(goal.yaw), 0));
  }

  moveTo(x, y) {
    this.position.x = x;
    this.position.y = y;
  }
}
