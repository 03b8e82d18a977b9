// The page: a column for each recording, one time for all of them. Names and texts come from bags,
// so they are only ever set as text.

const REPORT = JSON.parse(document.getElementById("data").textContent);
const slider = document.getElementById("slider"), play = document.getElementById("play");

// Return a new element with a text, in a parent.
function added(parent, tag, text = "", className = "") {
  const element = document.createElement(tag);
  element.textContent = text;
  if (className) element.className = className;
  parent.append(element);
  return element;
}

function counted(number, noun) {
  return `${number} ${noun}${number === 1 ? "" : "s"}`;
}

const NOTHING = 1e-6;  // Of mm, s or V: a rounding error.

function shown(value) {
  if (value === null) return "–";
  if (Math.abs(value) < NOTHING) return "0";
  return Number.isInteger(value) ? String(value) : value.toPrecision(3).replace(/e.*/, (e) => ` ${e}`);
}

// A recording: the choice of a flight, its replay, plots and events.
class Column {
  constructor(recording, parent) {
    this.recording = recording;
    this.section = added(parent, "section");
    const card = added(this.section, "div", "", "card");
    added(card, "h2", recording.name);
    added(card, "div", `${recording.start}, ${recording.duration.toFixed(1)} s, ${counted(recording.flights.length, "flight")}`, "quiet");
    for (const remark of recording.remarks) added(card, "div", remark, "remark");
    this.list(card);
    this.body = added(this.section, "div");
  }

  list(card) {
    const names = ["time to hover", "overshoot", "error in flight, rms", "error in flight, maximum", "touchdown speed"];
    const picked = names.map((name) => REPORT.figures.findIndex((each) => each[0] === name));
    const table = added(added(card, "div", "", "scroll"), "table"), head = added(table, "tr");
    added(head, "th", "flight");
    for (const name of ["begins", "lasts"]) added(head, "th", name, "number");
    for (const k of picked) if (k >= 0) added(head, "th", `${REPORT.figures[k][0]} (${REPORT.figures[k][1]})`, "number");
    this.rows = this.recording.flights.map((flight) => {
      const row = added(table, "tr", "", "choice");
      added(row, "td", `${flight.vehicle} ${flight.number}`);
      added(row, "td", `${(flight.start - this.recording.flights[0].start).toFixed(1)} s`, "number");
      added(row, "td", `${flight.duration.toFixed(1)} s`, "number");
      for (const k of picked) figureCell(row, flight.figures[k], k);
      row.addEventListener("click", () => { this.choose(flight); begin(); });
      return row;
    });
  }

  choose(flight) {
    this.flight = flight;
    this.rows.forEach((row, k) => row.classList.toggle("chosen", this.recording.flights[k] === flight));
    this.body.replaceChildren();
    const scene = added(added(this.body, "div", "", "card"), "canvas", "", "replay");
    this.replay = new Replay(scene, this.recording, () => draw());
    this.replay.choose(flight);
    const all = { from: -1, to: flight.duration + 1 };
    const view = { ...all, all }, grid = added(added(this.body, "div", "", "card"), "div", "", "plots");
    this.plots = flight.plots.map((data) => new Plot(grid, data, flight, view, seek, () => this.update()));
    // Only now it is known how wide they are.
    this.update();
    this.events();
  }

  events() {
    const card = added(this.body, "div", "", "card"), { events, more_events } = this.flight;
    added(card, "h2", "Events");
    if (!events.length) added(card, "div", "none: no refusal, hold, emergency, change or warning", "quiet");
    const table = added(added(card, "div", "", "scroll"), "table");
    for (const [time, kind, text, count] of events) {
      const row = added(table, "tr", "", "choice");
      added(row, "td", `${time.toFixed(2)} s`, "number");
      added(row, "td", kind, "kind").style.color = KINDS[kind];
      added(row, "td", count > 1 ? `${text} (${count} times)` : text);
      row.addEventListener("click", () => seek(time));
    }
    if (more_events) added(card, "div", `and ${more_events} more, see events.csv`, "quiet");
  }

  update() {
    for (const plot of this.plots) plot.update();
  }

  draw(time) {
    if (!this.flight) return;
    this.replay.draw(time);
    for (const plot of this.plots) plot.draw(time);
  }
}

function figureCell(row, [value, isNormal], k) {
  const cell = added(row, "td", shown(value), isNormal ? "number" : "number abnormal");
  if (value === null) cell.title = unknown(k);
}

function unknown(k) {
  return `not known: it needs ${REPORT.figures[k][2]}`;
}

function drawFigures() {
  const table = document.getElementById("figures"), chosen = columns.filter((each) => each.flight);
  table.replaceChildren();
  const head = added(table, "tr");
  for (const name of ["figure", "unit"]) added(head, "th", name);
  for (const { recording, flight } of chosen) {
    added(head, "th", `${recording.name}: ${flight.vehicle} ${flight.number}`, "number");
    added(head, "th", "normal");
  }
  REPORT.figures.forEach(([name, unit, , note], k) => {
    const row = added(table, "tr");
    added(row, "td", name);
    added(row, "td", unit);
    for (const { flight } of chosen) {
      const [value, , normal] = flight.figures[k];
      figureCell(row, flight.figures[k], k);
      added(row, "td", value === null ? unknown(k) : [normal, note].filter(Boolean).join(", "), "quiet");
    }
  });
}

function draw() {
  const time = Number(slider.value);
  document.getElementById("time").textContent = `${time.toFixed(2)} s`;
  for (const column of columns) column.draw(time);
}

function seek(time) {
  slider.value = time;
  draw();
}

// Start the replay of the flights that are chosen.
function begin() {
  const lasts = columns.filter((each) => each.flight).map((each) => each.flight.duration);
  slider.min = -1;
  slider.max = Math.max(0, ...lasts) + 1;
  drawFigures();
  seek(0);
}

let playing = null;
function step(now) {
  if (playing === null) return;
  const speed = Number(document.getElementById("speed").value);
  seek(Number(slider.value) + (now - playing) / 1000 * speed);
  playing = Number(slider.value) >= Number(slider.max) ? null : now;
  play.textContent = playing === null ? "▶ Play" : "❚❚ Pause";
  requestAnimationFrame(step);
}
play.addEventListener("click", () => {
  if (Number(slider.value) >= Number(slider.max)) seek(0);
  playing = playing === null ? performance.now() : null;
  play.textContent = playing === null ? "▶ Play" : "❚❚ Pause";
  requestAnimationFrame(step);
});
slider.addEventListener("input", draw);
window.addEventListener("resize", () => {
  for (const column of columns) if (column.flight) column.update();
  draw();
});

const columns = REPORT.recordings.map((each) => new Column(each, document.getElementById("columns")));
const count = REPORT.recordings.reduce((sum, each) => sum + each.flights.length, 0);
added(document.getElementById("summary"), "div",
  `${counted(count, "flight")} in ${counted(columns.length, "recording")}. Times count from each takeoff, s. “!”: not normal; “–”: not known. `
  + "Drag the scene to turn it; on plots: click to set the time, drag or wheel to zoom, double click for all. "
  + "Dashed: reference or command; a line that is broken: nothing was recorded there."
  + (REPORT.recordings.some((each) => each.flights.some((flight) => flight.others)) ? " Dotted, and grey in the replay: the other flight." : ""), "quiet");
for (const column of columns) if (column.recording.flights.length) column.choose(column.recording.flights[0]);
begin();
seek(Number(location.hash.slice(1)) || 0);  // report.html#7.5 begins at 7.5 s.
