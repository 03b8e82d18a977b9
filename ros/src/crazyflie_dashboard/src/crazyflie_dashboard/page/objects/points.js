// Points that are set in the scene: waypoints, and the two of a distance.

import { THREE } from "nicegui-scene";
import { label } from "./vehicles.js";

const COLOR = "#db4f98", NEAR = 0.08;  // Of a click on a line, m.

const line = (points) => new THREE.Line(new THREE.BufferGeometry().setFromPoints(points),
  new THREE.LineBasicMaterial({ color: COLOR }));
const ball = (point, size) => {
  const mesh = new THREE.Mesh(new THREE.SphereGeometry(size, 16, 10), new THREE.MeshBasicMaterial({ color: COLOR }));
  mesh.position.copy(point);
  return mesh;
};

// Take all out of a group, with its labels.
function empty(group) {
  for (const child of group.children) {
    child.geometry?.dispose();
    child.element?.remove();
  }
  group.clear();
}

export class Waypoints extends THREE.Group {
  points = [];

  // Show points [x, y, z] and the line through them.
  show(points) {
    this.points = points.map((each) => new THREE.Vector3(...each));
    this.draw();
  }

  draw() {
    empty(this);
    this.balls = this.points.map((point) => ball(point, 0.05));
    this.line = line(this.points);
    this.points.forEach((point, k) => {
      const tag = label(String(k + 1), "tag");
      tag.position.copy(point).setZ(point.z + 0.1);
      this.add(tag);
    });
    this.add(this.line, ...this.balls);
  }

  moveTo(number, { x, y }) {
    this.points[number].set(x, y, this.points[number].z);
    this.draw();
  }

  // Return the number and the height of the point that a ray hits.
  hit(ray) {
    const found = ray.intersectObjects(this.balls ?? [])[0];
    const number = found ? this.balls.indexOf(found.object) : -1;
    return number < 0 ? null : { number, z: this.points[number].z };
  }

  // Return where a ray comes near to the line, and the number of the point behind.
  hitLine(ray) {
    ray.params.Line.threshold = NEAR;
    const found = this.line && ray.intersectObject(this.line)[0];
    return found ? { number: found.index + 1, point: found.point } : null;
  }
}

// The distance between two points; a third one begins anew.
export class Measure extends THREE.Group {
  points = [];

  mark(point) {  // None of them for null.
    this.points = point === null ? [] : this.points.length === 1 ? [...this.points, point] : [point];
    empty(this);
    for (const each of this.points) this.add(ball(each, 0.03));
    if (this.points.length < 2) return;
    const [a, b] = this.points, tag = label(`${a.distanceTo(b).toFixed(3)} m`, "tag measure");
    tag.position.copy(a).lerp(b, 0.5);
    this.add(line(this.points), tag);
  }
}
