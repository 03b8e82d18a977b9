// What is around the vehicles: walls, obstacles, fence, planned trajectories, frames, and the goal.

import { THREE } from "nicegui-scene";
import { AXES, label } from "./vehicles.js";

// Return axes of a length, m, in the colors of x, y and z.
export const axesOf = (length) => new THREE.AxesHelper(length).setColors(...AXES.map((each) => new THREE.Color(each)));

const MANY = 1000;  // More balls or cylinders have fewer triangles.
const SHAPES = {
  box: () => new THREE.BoxGeometry(),
  cylinder: (detail) => new THREE.CylinderGeometry(0.5, 0.5, 1, 8 * detail).rotateX(Math.PI / 2),
  ball: (detail) => new THREE.SphereGeometry(0.5, 8 * detail, 4 * detail),
};

// Return numbers of an array that came as base64.
const unpacked = (text, type) => new type(Uint8Array.from(atob(text), (each) => each.charCodeAt(0)).buffer);

// Return solids as one object, whatever their number; see Solids of snapshot.py.
function drawn([shape, packedRows, packedColors, opacity, width]) {
  const rows = unpacked(packedRows, Float32Array), colors = unpacked(packedColors, Uint8Array);
  const look = { opacity, transparent: opacity < 1, depthWrite: opacity >= 1 }, tint = new THREE.Color();
  const color = (k) => tint.setRGB(colors[3 * k] / 255, colors[3 * k + 1] / 255, colors[3 * k + 2] / 255, THREE.SRGBColorSpace);
  if (!SHAPES[shape]) {
    const geometry = new THREE.BufferGeometry(), tints = new Float32Array(rows.length);
    for (let k = 0; k < rows.length / 3; k++) color(k).toArray(tints, 3 * k);
    geometry.setAttribute("position", new THREE.BufferAttribute(rows, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(tints, 3));
    Object.assign(look, { vertexColors: true });
    return shape === "points" ? new THREE.Points(geometry, new THREE.PointsMaterial({ ...look, size: width }))
      : new THREE.LineSegments(geometry, new THREE.LineBasicMaterial(look));
  }
  const count = rows.length / 10, detail = count > MANY ? 1 : 4;
  const mesh = new THREE.InstancedMesh(SHAPES[shape](detail), new THREE.MeshLambertMaterial(look), count);
  const position = new THREE.Vector3(), rotation = new THREE.Quaternion(), size = new THREE.Vector3();
  const matrix = new THREE.Matrix4();
  for (let k = 0, i = 0; k < count; k++, i += 10) {
    position.fromArray(rows, i);
    rotation.fromArray(rows, i + 3);
    size.fromArray(rows, i + 7);
    mesh.setMatrixAt(k, matrix.compose(position, rotation, size));
    mesh.setColorAt(k, color(k));
  }
  return mesh;
}

// Take all out of a group, with what the graphics card holds of it.
function empty(group) {
  for (const child of group.children) {
    child.geometry?.dispose();
    child.dispose?.();  // Of an instanced mesh.
  }
  group.clear();
}

export class Surroundings extends THREE.Group {
  constructor() {
    super();
    this.solids = new THREE.Group();
    this.fences = new THREE.Group();
    this.paths = new THREE.Group();
    this.frames = new Map();
    this.add(this.solids, this.fences, this.paths);
  }

  // Replace walls, obstacles, points and lines.
  setSolids(solids) {
    empty(this.solids);
    this.solids.add(...solids.map(drawn));
  }

  // Put them where their frames are: positions and quaternions, in the same order.
  placeSolids(places) {
    places.forEach(([position, rotation], k) => {
      this.solids.children[k].position.set(...position);
      this.solids.children[k].quaternion.set(...rotation);
    });
  }

  // Replace the geofences: two corners in a frame, and its position and quaternion.
  setFences(fences) {
    empty(this.fences);
    for (const [lower, upper, position, rotation] of fences) {
      const box = new THREE.Box3(new THREE.Vector3(...lower), new THREE.Vector3(...upper));
      const frame = new THREE.Group().add(new THREE.Box3Helper(box, "#e0a030"));
      frame.position.set(...position);
      frame.quaternion.set(...rotation);
      this.fences.add(frame);
    }
  }

  // Replace the planned trajectories: lists of points, each with its color.
  setPaths(paths) {
    empty(this.paths);
    for (const [path, color] of paths) {
      const points = path.map((point) => new THREE.Vector3(...point));
      this.paths.add(new THREE.Line(new THREE.BufferGeometry().setFromPoints(points),
        new THREE.LineBasicMaterial({ color })));
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
        const axes = axesOf(0.12);
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
