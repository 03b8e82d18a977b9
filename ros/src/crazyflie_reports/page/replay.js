// The replay: vehicles, their paths and references in three dimensions; drag to turn, wheel to zoom.

const ARM = 0.046, ROTOR = 0.023;  // Of a Crazyflie, m: half of its diagonal, radius of a propeller.
const SMALLEST = 0.13;             // Smallest arm that is drawn, as a fraction of what is seen.
const OLD = 0.1;                   // s; a pose that is older is not where the vehicle is.
const MANY = 25;                   // More vehicles are drawn smaller; only the chosen one has its name.

// Return the drawing context of a canvas whose pixels fit the screen's, and its size, px of CSS.
function fitted(canvas) {
  const scale = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  canvas.width = Math.max(1, box.width * scale);
  canvas.height = Math.max(1, box.height * scale);
  const context = canvas.getContext("2d");
  context.scale(scale, scale);
  context.font = "11px system-ui, sans-serif";
  return [context, box.width, box.height];
}

// Return the pose of a path at a time, as [x, y, z, roll, pitch, yaw, ...], and its age, s. It is
// between two rows; in a gap, and at the path's end, the last one. Before the first it is that one.
function poseAt({ rows, start, period }, time) {
  const place = Math.max((time - start) / period, 0), next = Math.floor(place) + 1;
  let k = Math.min(next - 1, rows.length - 1);
  if (rows[k] && rows[next]) return [rows[k].map((value, i) => value + (place - k) * (rows[next][i] - value)), 0];
  while (k > 0 && !rows[k]) k--;
  return [rows[k], (place - k) * period];
}

// R = Rx(roll) Ry(pitch) Rz(yaw), times a vector.
function rotated([x, y, z], roll, pitch, yaw) {
  [x, y] = [x * Math.cos(yaw) - y * Math.sin(yaw), x * Math.sin(yaw) + y * Math.cos(yaw)];
  [x, z] = [x * Math.cos(pitch) + z * Math.sin(pitch), -x * Math.sin(pitch) + z * Math.cos(pitch)];
  return [x, y * Math.cos(roll) - z * Math.sin(roll), y * Math.sin(roll) + z * Math.cos(roll)];
}

class Replay {
  constructor(canvas, recording, redraw) {
    Object.assign(this, { canvas, recording, redraw, turn: -0.9, tilt: 0.45, zoom: 1 });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.grip = [event.clientX, event.clientY, this.turn, this.tilt];
    });
    canvas.addEventListener("pointerup", () => { this.grip = null; });
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom = Math.min(20, Math.max(0.2, this.zoom * Math.exp(-event.deltaY * 0.001)));
      redraw();
    }, { passive: false });
  }

  // Show a flight of the recording, with others of the same time, or that it is compared with, around it.
  choose(flight) {
    this.flight = flight;
    const flights = [...this.recording.flights, ...(flight.others ?? [])];
    this.others = flights.filter((each) => each !== flight && each.path
      && each.vehicle !== flight.vehicle && each.start < flight.start + flight.duration
      && each.start + each.duration > flight.start);
    const rows = [flight, ...this.others].flatMap((each) => each.path ? each.path.rows.filter(Boolean) : []);
    const low = [0, 1, 2].map((k) => rows.reduce((best, row) => Math.min(best, row[k]), Infinity));
    const high = [0, 1, 2].map((k) => rows.reduce((best, row) => Math.max(best, row[k]), -Infinity));
    this.floor = Math.min(0, low[2]);
    this.center = low.map((value, k) => (value + high[k]) / 2);
    this.radius = Math.max(0.6, Math.hypot(...low.map((value, k) => high[k] - value)) / 2);
  }

  drag(event) {
    if (!this.grip) return;
    const [x, y, turn, tilt] = this.grip;
    this.turn = turn - (event.clientX - x) * 0.008;
    this.tilt = Math.min(1.57, Math.max(-0.1, tilt + (event.clientY - y) * 0.006));
    this.redraw();
  }

  // Return where a point (m) is on the canvas, px.
  project([x, y, z]) {
    const [cx, cy, cz] = this.center;
    [x, y, z] = [x - cx, y - cy, z - cz];
    const right = -x * Math.sin(this.turn) + y * Math.cos(this.turn);
    const deep = x * Math.cos(this.turn) + y * Math.sin(this.turn);
    const up = z * Math.cos(this.tilt) - deep * Math.sin(this.tilt);
    return [this.width / 2 + right * this.scale, this.height / 2 - up * this.scale];
  }

  // Draw the vehicles where they were at a time after the start of the flight, s.
  draw(time) {
    const [context, width, height] = fitted(this.canvas);
    if (!this.flight.path) {
      context.fillText("Its position was not recorded.", 20, 30);
      return;
    }
    Object.assign(this, { context, width, height, scale: Math.min(width, height) * 0.46 / this.radius * this.zoom });
    this.ground();
    for (const other of this.others) {
      const at = time + this.flight.start - other.start;
      this.line(other.path.rows, "#d0d5dd", 1);
      this.vehicle(other, poseAt(other.path, at)[0], "#98a2b3");
    }
    const { path } = this.flight, done = Math.ceil((time - path.start) / path.period);
    this.line(path.rows, "#bfd3fb", 1.2);
    this.line(path.rows.slice(0, Math.max(0, done)), "#2563eb", 2.2);
    const [pose, age] = poseAt(path, time);
    if (pose.length > 6) this.cross(pose.slice(6));
    this.line([pose, [pose[0], pose[1], this.floor]], "#98a2b3", 1, [3, 3]);
    this.vehicle(this.flight, pose, age > OLD ? "#98a2b3" : "#1c2330");
    this.words(pose, age);
  }

  words(pose, age) {
    const where = ["x", "y", "z"].map((name, k) => `${name} ${pose[k].toFixed(2)}`).join("  ");
    this.said = age > OLD ? `no state for ${age.toFixed(1)} s; the last one: ${where} m` : `${where} m`;
    this.context.fillStyle = age > OLD ? "#b42318" : "#475467";
    this.context.fillText(this.said, 10, this.height - 10);
    this.context.fillStyle = "#667085";
    const size = this.arm > 1.05 * ARM ? `; the vehicle is drawn ${(this.arm / ARM).toFixed(1)} times as large` : "";
    this.context.fillText(`grid ${this.step} m; bold propellers: front; cross: reference${size}`, 10, this.height - 26);
  }

  ground() {
    const step = this.radius > 8 ? 5 : this.radius > 2.5 ? 1 : 0.5;
    this.step = step;
    const reach = Math.ceil(this.radius / step) * step;
    const [cx, cy] = this.center.map((each) => Math.round(each / step) * step);
    for (let d = -reach; d <= reach + 1e-9; d += step) {
      this.line([[cx + d, cy - reach, this.floor], [cx + d, cy + reach, this.floor]], "#e4e7ec", 1);
      this.line([[cx - reach, cy + d, this.floor], [cx + reach, cy + d, this.floor]], "#e4e7ec", 1);
    }
    // The colors of x, y and z in the plots.
    ["x", "y", "z"].forEach((name, k) => {
      const color = COLORS[k];
      const tip = [0, 0, this.floor];
      tip[k] += step / 2;
      this.line([[0, 0, this.floor], tip], color, 2);
      this.context.fillStyle = color;
      this.context.fillText(name, ...this.project(tip));
    });
  }

  // Draw a line through points, with a gap where there is none.
  line(points, color, width, dash = []) {
    const { context } = this;
    context.strokeStyle = color;
    context.lineWidth = width;
    context.setLineDash(dash);
    context.beginPath();
    points.forEach((point, k) => {
      if (point) context[points[k - 1] ? "lineTo" : "moveTo"](...this.project(point));
    });
    context.stroke();
    context.setLineDash([]);
  }

  // The reference.
  cross(point) {
    const size = this.radius * 0.03;
    for (const k of [0, 1, 2]) {
      const [a, b] = [[...point], [...point]];
      a[k] -= size;
      b[k] += size;
      this.line([a, b], "#7b3fa0", 2);
    }
  }

  // A Crazyflie: two arms, four propellers, of which those in front are bold.
  vehicle(flight, pose, color) {
    const crowd = Math.max(1, this.others.length / MANY);
    const arm = Math.max(ARM, SMALLEST * this.radius / this.zoom / Math.sqrt(crowd)), size = arm / ARM * ROTOR;
    if (flight === this.flight) this.arm = arm;
    const at = (vector) => rotated(vector, pose[3], pose[4], pose[5]).map((value, k) => value + pose[k]);
    for (const quarter of [1, 3, 5, 7]) {
      const angle = quarter * Math.PI / 4, [x, y] = [Math.cos(angle) * arm, Math.sin(angle) * arm];
      this.line([at([0, 0, 0]), at([x, y, 0])], color, 2);
      const ring = [];
      for (let k = 0; k <= 16; k++) {
        const turn = k * Math.PI / 8;
        ring.push(at([x + size * Math.cos(turn), y + size * Math.sin(turn), 0.006]));
      }
      this.line(ring, color, x > 0 ? 3.2 : 1.2);
    }
    if (crowd > 1 && flight !== this.flight) return;
    const [left, top] = this.project([pose[0], pose[1], pose[2] + 1.4 * arm]);
    this.context.fillStyle = color;
    this.context.fillText(flight.vehicle, left + 10, top);
  }
}
