// All vehicles of the scene as a few instanced meshes: a hundred are drawn in as many calls as one.

import { CSS2DObject, THREE } from "nicegui-scene";

const SMALLEST = 0.045;     // Smallest size of a vehicle, as a fraction of its distance.
const LENGTH = 0.13;        // Of a vehicle with its propellers, m.
const SPIN = 25;            // Turning of drawn propellers, rad/s: real ones are too fast to be seen.
const TRAIL = 30;           // Length of a trail, s.
const DETAIL = 0.0205;      // Size of a part that is a detail, m: only FEW vehicles have them.
const FLAT = 0.002;         // Height of a box that is a rectangle then, m.
export const FEW = 20;      // More vehicles are drawn with fewer triangles, trails with fewer points.
const CONDITIONS = ["ground", "flight", "stale", "emergency"];
// By a vehicle's condition, its number in the list above.
const TINTS = ["#ffffff", "#ffffff", "#5b6068", "#ff4040"].map((text) => new THREE.Color(text));
const RINGS = ["#8b97a8", "#35c98a", "#5b6068", "#ff3b3b"].map((text) => new THREE.Color(text));
// Of x, y and z, as in the plots and in the report.
export const AXES = ["#1f86cc", "#d98200", "#0f9f76"];
const CHOSEN = new THREE.Color("#4ea1ff");

// Return a text in the scene. It is set as text, never as HTML.
export function label(text, kind) {
  const element = document.createElement("div");
  element.textContent = text;
  element.className = kind;
  return new CSS2DObject(element);
}

// Return the geometry of a primitive.
function primitive(shape, size, isDetailed) {
  if (shape === "sphere") return new THREE.SphereGeometry(size[0], 6, 4);
  if (shape === "cylinder") return new THREE.CylinderGeometry(size[0], size[0], size[1], 10).rotateX(Math.PI / 2);
  return isDetailed || size[2] > FLAT ? new THREE.BoxGeometry(...size) : new THREE.PlaneGeometry(size[0], size[1]);
}

// Return one geometry with the colors of several primitives: [shape, size, position, rpy, color].
function merged(parts, isDetailed) {
  const arrays = { position: [], normal: [], color: [] };
  for (const [shape, size, position, rpy, color] of parts) {
    const geometry = primitive(shape, size, isDetailed).toNonIndexed(), tint = new THREE.Color(...color.slice(0, 3));
    geometry.applyMatrix4(new THREE.Matrix4().makeRotationFromEuler(new THREE.Euler(...rpy, "ZYX"))
      .setPosition(...position));
    for (const name of ["position", "normal"]) arrays[name].push(...geometry.attributes[name].array);
    for (let k = 0; k < geometry.attributes.position.count; k++) arrays.color.push(tint.r, tint.g, tint.b);
  }
  const whole = new THREE.BufferGeometry();
  for (const [name, values] of Object.entries(arrays))
    whole.setAttribute(name, new THREE.Float32BufferAttribute(values, 3));
  return whole;
}

// Return the body and the propellers of a vehicle's model: parts with the number of a propeller in
// front (0 for the body), those of a propeller around the center of its hub.
function bodyParts(model, isDetailed) {
  const of = (number, center) => merged(model
    .filter(([each, , size]) => each === number && (isDetailed || Math.max(...size) > DETAIL))
    .map(([, shape, size, position, ...rest]) =>
      [shape, size, position.map((value, k) => value - center[k]), ...rest]), isDetailed);
  const propellers = [1, 2, 3, 4].map((number) => {
    const center = model.find(([each]) => each === number)[3];
    return { center: new THREE.Vector3(...center), geometry: of(number, center) };
  });
  return { body: of(0, [0, 0, 0]), propellers };
}

// Where vehicles have been in the last half minute, as one object: it is drawn at once.
class Trails extends THREE.LineSegments {
  constructor(number) {
    super(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ vertexColors: true }));
    this.points = Array.from({ length: number }, () => []);
    this.samples = number > FEW ? 60 : 120;
    const vertices = Math.max(1, number) * (this.samples - 1) * 2;
    this.geometry.setAttribute("position", new THREE.Float32BufferAttribute(new Float32Array(vertices * 3), 3));
    this.geometry.setAttribute("color", new THREE.Float32BufferAttribute(new Float32Array(vertices * 3), 3));
    this.frustumCulled = false;
    this.next = 0;
  }

  extend(poses) {
    const now = performance.now() / 1000;
    if (now < this.next) return;
    this.next = now + TRAIL / this.samples;
    const { position, color } = this.geometry.attributes;
    let vertex = 0;
    poses.forEach((pose, i) => {
      const points = this.points[i];
      if (pose[0] !== null && pose[7] !== 2) points.push(pose.slice(0, 3));
      if (points.length > this.samples) points.shift();
      for (let k = 1; k < points.length; k++) {
        for (const point of [points[k - 1], points[k]]) {
          const fade = 0.25 + 0.75 * k / points.length;
          position.setXYZ(vertex, ...point);
          color.setXYZ(vertex++, 0.2 * fade, 0.65 * fade, 1.0 * fade);
        }
      }
    });
    this.geometry.setDrawRange(0, vertex);
    position.needsUpdate = color.needsUpdate = true;
  }
}


// Vehicles of the given names; `model` has the parts of each.
export class Vehicles extends THREE.Group {
  constructor(names, model) {
    super();
    this.names = names;
    this.poses = [];
    const isDetailed = names.length <= FEW;
    const parts = bodyParts(model, isDetailed);
    const look = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide });
    this.body = this.instances(parts.body, look);
    this.propellers = parts.propellers.map(({ center, geometry }) =>
      Object.assign(this.instances(geometry, look), { center }));
    this.rings = this.instances(new THREE.RingGeometry(0.085, 0.1, isDetailed ? 32 : 16),
      new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
    this.references = this.instances(new THREE.OctahedronGeometry(0.018),
      new THREE.MeshBasicMaterial({ color: "#ffc857", wireframe: true, transparent: true, opacity: 0.5 }));
    this.trails = new Trails(names.length);
    this.tags = names.map((name) => label(name, "tag"));
    this.add(this.trails, ...this.tags);
  }

  instances(geometry, material) {
    const mesh = new THREE.InstancedMesh(geometry, material, Math.max(1, this.names.length));
    mesh.count = this.names.length;
    mesh.frustumCulled = false;
    this.add(mesh);
    return mesh;
  }

  // Return the last position of a vehicle; null if it is not known.
  positionOf(name) {
    const pose = this.poses[this.names.indexOf(name)];
    return pose && pose[0] !== null ? new THREE.Vector3(...pose.slice(0, 3)) : null;
  }

  // Set the poses, in the order of the names: each x, y, z (null if not known), quaternion x, y, z,
  // w, condition, chosen, a text behind the name, and position of the reference if there is one.
  update(poses) {
    this.poses = poses;
    this.isTurning = poses.some((pose) => pose[7] === 1);
    this.references.visible = poses.some((pose) => pose.length > 10);
    poses.forEach((pose, i) => {
      const element = this.tags[i].element;
      const text = pose[9] ? `${this.names[i]} · ${pose[9]}` : this.names[i];
      const kind = `tag ${CONDITIONS[pose[7]]}${pose[8] ? " chosen" : ""}`;
      if (element.textContent !== text) element.textContent = text;
      if (element.className !== kind) element.className = kind;
      this.tags[i].visible = pose[0] !== null;
      this.rings.setColorAt(i, pose[8] && pose[7] < 2 ? CHOSEN : RINGS[pose[7]]);
      for (const mesh of [this.body, ...this.propellers]) mesh.setColorAt(i, TINTS[pose[7]]);
    });
    for (const mesh of [this.rings, this.body, ...this.propellers])
      if (mesh.instanceColor) mesh.instanceColor.needsUpdate = true;
    if (this.trails.visible) this.trails.extend(poses);
  }

  setPast(isPast) {
    this.trails.visible = !isPast;
  }

  // Put the instances where the poses say; a far vehicle is drawn larger, to be seen at all.
  place(camera, time) {
    const matrix = new THREE.Matrix4(), turn = new THREE.Matrix4();
    const position = new THREE.Vector3(), size = new THREE.Vector3();
    const rotation = new THREE.Quaternion(), upright = new THREE.Quaternion();
    this.poses.forEach((pose, i) => {
      const isKnown = pose[0] !== null, reference = pose.slice(10, 13);
      position.set(...(isKnown ? pose.slice(0, 3) : [0, 0, 0]));
      rotation.set(pose[3], pose[4], pose[5], pose[6]);
      const far = camera.position.distanceTo(position) * SMALLEST / LENGTH;
      size.setScalar(isKnown ? Math.max(1, far) : 0);
      this.body.setMatrixAt(i, matrix.compose(position, rotation, size));
      this.propellers.forEach((mesh, k) => {
        const angle = pose[7] === 1 ? (k % 2 ? 1 : -1) * SPIN * time : 0;
        mesh.setMatrixAt(i, turn.makeRotationZ(angle).setPosition(mesh.center).premultiply(matrix));
      });
      this.tags[i].position.copy(position).setZ(position.z + 0.09 * size.z);
      this.rings.setMatrixAt(i, matrix.compose(position, upright, size));
      if (reference.length) position.set(...reference);
      size.setScalar(reference.length && isKnown ? size.x : 0);
      this.references.setMatrixAt(i, matrix.compose(position, upright, size));
    });
    for (const mesh of [this.body, this.rings, this.references, ...this.propellers])
      mesh.instanceMatrix.needsUpdate = true;
  }

  // Take the vehicles away; labels would otherwise stay in the document.
  dispose() {
    this.removeFromParent();
    this.tags.forEach((tag) => tag.element.remove());
    for (const mesh of this.children) mesh.geometry?.dispose();
  }
}
