// Plots of numbers over time: curves, phases as bands, events as ticks, a cursor; wheel to zoom,
// drag to move, double click for all.

const COLORS = ["#2563eb", "#dc2626", "#059669", "#9333ea", "#d97706", "#475569"];
const BANDS = { "taking off": "#e3f2e6", "flying": "#ffffff", "descending": "#fdf1dc", "landing": "#fbe3d4" };
const KINDS = {
  "refusal": "#d97706", "pose rejected": "#9333ea", "hold": "#0891b2", "emergency": "#b42318",
  "link": "#be185d", "battery": "#a16207", "parameter": "#2563eb", "warning": "#ca8a04", "error": "#b42318",
};
const LEFT = 52, RIGHT = 16, TOP = 22, BOTTOM = 20;

// Return the drawing context of a canvas whose pixels fit the screen's.
function fitted(canvas) {
  const scale = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
  canvas.width = Math.max(1, box.width * scale);
  canvas.height = Math.max(1, box.height * scale);
  const context = canvas.getContext("2d");
  context.scale(scale, scale);
  context.font = "11px system-ui, sans-serif";
  return [context, box.width, box.height];
}

// Return round numbers from low to high, about `count` of them.
function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((each) => each * power).find((each) => each >= raw);
  const result = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) result.push(Number((k * step).toPrecision(6)));
  return result;
}

// Return the index of the last time that is not after `time`, or -1.
function indexAt(times, time) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1; else high = middle;
  }
  return low - 1;
}

// A plot; `view` = {from, to} is shared by the plots of a column, `seek(time)` moves the cursor,
// `redraw()` draws all that share the view.
class Plot {
  constructor(canvas, data, flight, view, seek, redraw) {
    Object.assign(this, { canvas, data, flight, view, seek, redraw });
    canvas.addEventListener("wheel", (event) => this.zoom(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.grip = [event.offsetX, { ...view }];
      this.moved = false;
    });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", () => { this.grip = null; });
    canvas.addEventListener("click", (event) => { if (!this.moved) seek(this.timeAt(event.offsetX)); });
    canvas.addEventListener("dblclick", () => { Object.assign(view, view.all); redraw(); });
  }

  get width() { return this.canvas.clientWidth - LEFT - RIGHT; }
  timeAt(x) { return this.view.from + (x - LEFT) / this.width * (this.view.to - this.view.from); }

  zoom(event) {
    event.preventDefault();
    const center = this.timeAt(event.offsetX), factor = Math.exp(event.deltaY * 0.0015);
    const { view } = this;
    if ((view.to - view.from) * factor < 0.02) return;
    view.from = Math.max(view.all.from, center + (view.from - center) * factor);
    view.to = Math.min(view.all.to, center + (view.to - center) * factor);
    this.redraw();
  }

  move(event) {
    if (!this.grip) return;
    const [x, old] = this.grip, { view } = this;
    this.moved = this.moved || Math.abs(event.offsetX - x) > 3;
    const span = old.to - old.from, shift = (x - event.offsetX) / this.width * span;
    view.from = Math.min(Math.max(view.all.from, old.from + shift), view.all.to - span);
    view.to = view.from + span;
    this.redraw();
  }

  // Draw with the cursor at a time, s.
  draw(time) {
    const [context, width, height] = fitted(this.canvas), { view } = this;
    const [low, high] = this.limits();
    const x = (t) => LEFT + (t - view.from) / (view.to - view.from) * (width - LEFT - RIGHT);
    const y = (v) => height - BOTTOM - (v - low) / (high - low) * (height - TOP - BOTTOM);
    this.axes(context, x, y, width, height, low, high);
    context.save();
    context.beginPath();
    context.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
    context.clip();
    this.data.curves.forEach((curve, k) => this.curve(context, curve, k, x, y));
    for (const [when, kind] of this.flight.events) {
      context.fillStyle = KINDS[kind] || "#000";
      context.fillRect(x(when) - 1, TOP, 2, 9);
    }
    context.strokeStyle = "#111";
    context.beginPath();
    context.moveTo(x(time), TOP);
    context.lineTo(x(time), height - BOTTOM);
    context.stroke();
    context.restore();
    this.legend(context, time);
  }

  limits() {
    let low = Infinity, high = -Infinity;
    for (const { t, v } of this.data.curves)
      for (let k = Math.max(0, indexAt(t, this.view.from)); k < t.length && t[k] <= this.view.to; k++) {
        low = Math.min(low, v[k]);
        high = Math.max(high, v[k]);
      }
    if (low > high) [low, high] = [0, 1];
    const margin = Math.max((high - low) * 0.08, 1e-3);
    return [low - margin, high + margin];
  }

  axes(context, x, y, width, height, low, high) {
    for (const [name, from, to] of this.flight.phases) {
      const left = Math.max(LEFT, x(from)), right = Math.min(width - RIGHT, x(to));
      if (right <= left) continue;
      context.fillStyle = BANDS[name] || "#f1f5f9";
      context.fillRect(left, TOP, right - left, height - TOP - BOTTOM);
      context.fillStyle = "#98a2b3";
      if (right - left > context.measureText(name).width) context.fillText(name, left + 3, TOP + 20);
    }
    context.strokeStyle = "#e4e7ec";
    context.fillStyle = "#475467";
    context.beginPath();
    context.textAlign = "right";
    for (const value of ticks(low, high, 4)) {
      context.moveTo(LEFT, y(value));
      context.lineTo(width - RIGHT, y(value));
      context.fillText(value, LEFT - 5, y(value) + 4);
    }
    context.textAlign = "center";
    for (const value of ticks(this.view.from, this.view.to, width / 90)) {
      context.moveTo(x(value), TOP);
      context.lineTo(x(value), height - BOTTOM);
      context.fillText(`${value} s`, x(value), height - 6);
    }
    context.stroke();
    context.textAlign = "left";
  }

  curve(context, { name, t, v }, k, x, y) {
    const isStep = name.endsWith("reference");
    context.strokeStyle = this.color(name, k);
    context.setLineDash(name.includes(" ") ? [5, 3] : []);
    context.lineWidth = 1.4;
    context.beginPath();
    for (let i = Math.max(0, indexAt(t, this.view.from)); i < t.length; i++) {
      if (isStep && i > 0) context.lineTo(x(t[i]), y(v[i - 1]));
      context.lineTo(x(t[i]), y(v[i]));
      if (t[i] > this.view.to) break;
    }
    context.stroke();
    context.setLineDash([]);
    context.lineWidth = 1;
  }

  // A commanded or reference value has the color of what follows it.
  color(name, k) {
    const first = this.data.curves.findIndex((each) => each.name === name.split(" ")[0]);
    return COLORS[(first < 0 ? k : first) % COLORS.length];
  }

  legend(context, time) {
    context.fillStyle = "#1c2330";
    context.fillText(`${this.data.title} (${this.data.unit})`, 4, 13);
    let left = 14 + context.measureText(`${this.data.title} (${this.data.unit})`).width;
    this.data.curves.forEach(({ name, t, v }, k) => {
      const index = indexAt(t, time), value = index < 0 ? "–" : v[index].toFixed(2);
      const text = name.includes(" ") ? `- - ${name}` : `${name} ${value}`;
      context.fillStyle = this.color(name, k);
      context.fillText(text, left, 13);
      left += context.measureText(text).width + 10;
    });
  }
}
