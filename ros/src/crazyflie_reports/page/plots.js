// Plots of numbers over time, by uPlot: phases as bands, events as ticks, the time of the replay as a
// line; wheel or drag to zoom, click to set the time, double click for all.

// Those of x, y and z are the dashboard's, too. None is red, which is for what is not normal; they can be told
// apart by those who see no red or green.
const COLORS = ["#1f86cc", "#d98200", "#0f9f76", "#9257c2", "#64748b"];
const BANDS = { "taking off": "#e3f2e6", "flying": "transparent", "descending": "#fdf1dc", "landing": "#fbe3d4" };
const KINDS = {
  "refusal": "#b45309", "pose rejected": "#9333ea", "hold": "#0891b2", "emergency": "#b42318",
  "link": "#be185d", "battery": "#a16207", "parameter": "#2563eb", "warning": "#a16207", "error": "#b42318",
};
const HEIGHT = 150;       // Of a plot, px of CSS.
const SHORTEST = 0.02;    // Time that can be zoomed to, s.
const CLICK = 3;          // A pointer that moves further, px, has not clicked.

// Return the index of the last time that is not after `time`, or -1.
function indexAt(times, time) {
  return times.findLastIndex((each) => each <= time);
}

// Return the limits of an axis for values from low to high.
function padded(low, high) {
  if (low === null) return [0, 1];
  const margin = Math.max((high - low) * 0.08, 1e-3);
  return [low - margin, high + margin];
}

// A plot; `view` = {from, to, all} is shared by the plots of a column, `seek(time)` sets the time of
// the replay, `zoomed()` is called when the view has changed.
class Plot {
  constructor(parent, data, flight, view, seek, zoomed) {
    Object.assign(this, { data, flight, view, seek, zoomed, time: 0 });
    this.parent = added(parent, "div", "", "plot");
    added(this.parent, "h3", `${data.title} (${data.unit})`);
    // Curves have times of their own: where one has no value, its line goes on. A gap is null from
    // the last value before it to the first one behind it (2).
    const tables = data.curves.map(({ name, t, v }) =>
      name.endsWith("reference") ? [[...t, view.all.to], [...v, v.at(-1)]] : [t, v]);
    this.uplot = new uPlot(this.options(), uPlot.join(tables, tables.map(() => [2, 2])), this.parent);
    this.line = added(this.uplot.over, "div", "", "now");
    this.bind(this.uplot.over);
  }

  options() {
    const { view, data } = this;
    return {
      width: this.parent.clientWidth, height: HEIGHT,
      scales: { x: { time: false, range: () => [view.from, view.to] }, y: { range: (_, low, high) => padded(low, high) } },
      axes: [
        { size: 24, gap: 2, values: (_, ticks) => ticks.map((each) => `${each} s`), grid: { stroke: "#e4e7ec" }, ticks: { show: false } },
        { size: 44, gap: 2, grid: { stroke: "#e4e7ec" }, ticks: { show: false } },
      ],
      // Under the mouse it is the time of the nearest sample.
      series: [{ value: (u, time) => `${(u.over.matches(":hover") ? time ?? this.time : this.time).toFixed(2)} s`, label: "time" },
        ...data.curves.map((curve, k) => this.series(curve, k))],
      cursor: { y: false, drag: { setScale: false }, dataIdx: (u, k, index) => this.known(u, k, index), bind: { dblclick: () => null } },
      hooks: {
        drawClear: [(u) => this.bands(u)], draw: [(u) => { this.ticks(u); this.place(); }], setLegend: [(u) => this.legend(u)],
        setSelect: [(u) => { if (u.select.width > CLICK) this.zoom(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")); }],
      },
    };
  }

  series({ name, v }, k) {
    const first = this.data.curves.findIndex((each) => each.name === name.split(" ")[0]);
    return {
      // A commanded or reference value has the color of what follows it.
      label: name, stroke: COLORS[(first < 0 ? k : first) % COLORS.length], width: 1.4,
      // Of a flight that is laid over this one.
      dash: / (what if|recorded|first|second)$/.test(name) ? [1, 2] : name.includes(" ") ? [5, 3] : undefined,
      paths: name.endsWith("reference") ? uPlot.paths.stepped({ align: 1 }) : undefined,
      points: name.endsWith("reference") ? { show: false } : { size: 4 },
      value: (_, value) => value === null || value === undefined ? "–" : value.toFixed(2),
    };
  }

  // Return the last index until `index` at which curve `k` has a value or a gap.
  known(u, k, index) {
    const values = u.data[k];
    while (index > 0 && values[index] === undefined) index--;
    return index;
  }

  bind(over) {
    let pressed = 0;
    over.addEventListener("pointerdown", (event) => { pressed = event.clientX; });
    over.addEventListener("click", (event) => {
      if (Math.abs(event.clientX - pressed) <= CLICK) this.seek(this.uplot.posToVal(event.offsetX, "x"));
    });
    over.addEventListener("dblclick", () => this.zoom(this.view.all.from, this.view.all.to));
    over.addEventListener("mouseleave", () => this.draw(this.time));
    over.addEventListener("wheel", (event) => {
      event.preventDefault();
      const { view } = this, center = this.uplot.posToVal(event.offsetX, "x"), factor = Math.exp(event.deltaY * 0.0015);
      this.zoom(center + (view.from - center) * factor, center + (view.to - center) * factor);
    }, { passive: false });
  }

  zoom(from, to) {
    this.uplot.setSelect({ left: 0, width: 0 }, false);
    if (to - from < SHORTEST) return;
    const { view } = this;
    Object.assign(view, { from: Math.max(view.all.from, from), to: Math.min(view.all.to, to) });
    this.zoomed();
  }

  // Show the part of time that the view has, at the width that there is.
  update() {
    this.uplot.setSize({ width: this.parent.clientWidth, height: HEIGHT });
    this.uplot.setScale("x", { min: this.view.from, max: this.view.to });
    this.draw(this.time);
  }

  // Show the values at a time of the replay, s; under the mouse are those of there.
  draw(time) {
    this.time = time;
    this.place();
    this.legend(this.uplot);
  }

  // Put the line of the present moment where it belongs, which is known when the plot was drawn.
  place() {
    const { line, time, uplot, view } = this;
    line.style.left = `${uplot.valToPos(time, "x")}px`;
    line.hidden = time < view.from || time > view.to;
  }

  legend(u) {
    if (u.over.matches(":hover")) return;
    const index = indexAt(u.data[0], this.time);
    u.setLegend({ idxs: u.data.map((_, k) => index < 0 ? null : this.known(u, k, index)) }, false);
  }

  bands(u) {
    const { ctx, bbox } = u, scale = devicePixelRatio;
    ctx.save();
    ctx.font = `${11 * scale}px system-ui, sans-serif`;
    for (const [name, from, to] of this.flight.phases) {
      const left = Math.max(bbox.left, u.valToPos(from, "x", true));
      const width = Math.min(bbox.left + bbox.width, u.valToPos(to, "x", true)) - left;
      if (width <= 0) continue;
      ctx.fillStyle = BANDS[name] || "#f1f5f9";
      ctx.fillRect(left, bbox.top, width, bbox.height);
      ctx.fillStyle = "#98a2b3";
      if (width > ctx.measureText(name).width) ctx.fillText(name, left + 3 * scale, bbox.top + 22 * scale);
    }
    ctx.restore();
  }

  ticks(u) {
    for (const [time, kind] of this.flight.events) {
      const left = u.valToPos(time, "x", true);
      if (left < u.bbox.left || left > u.bbox.left + u.bbox.width) continue;
      u.ctx.fillStyle = KINDS[kind] || "#000";
      u.ctx.fillRect(left - devicePixelRatio, u.bbox.top, 2 * devicePixelRatio, 9 * devicePixelRatio);
    }
  }
}
