"""Plots of a minute of the vehicles that are chosen, that can be stopped, measured and kept."""

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from nicegui import context, json, ui
from nicegui.elements.mixins.value_element import ValueElement
from nicegui.events import GenericEventArguments, ValueChangeEventArguments

from crazyflie_dashboard.page.scene_view import ANSWER_LIMIT, COLORS
from crazyflie_dashboard.page.session import Session
from crazyflie_dashboard.page_data import Series
from crazyflie_dashboard.snapshot import Scene

SPAN = 60.0  #: Time that is shown (s).
MAX_POINTS = 300  #: Largest number of points of a line: the plot has no pixels for more.
HEIGHT, GAP, TOP = 105, 34, 26  #: Height of a plot, space between two and above the first (px).

#: Colors of x, y and z, those of the report; `vehicles.js` has them for the scene's axes.
AXES = {"x": "#1f86cc", "y": "#d98200", "z": "#0f9f76"}
#: What is plotted before anything else is chosen: names of `VehiclePlots`.
FIRST = (
    "position x",
    "position y",
    "position z",
    "error",
    "roll",
    "pitch",
    "yaw",
    "thrust",
    "battery",
)
#: What a vehicle has plots of, if it is received.
KNOWN = {
    "position": ("position x", "position y", "position z", "reference position z", "error"),
    "velocity": ("velocity x", "velocity y", "velocity z"),
    "attitude": ("roll", "pitch", "yaw"),
    "other": ("thrust", "battery"),
}

DIM = {"color": "#7d8899"}  #: Style of texts in the plots.
TOOLTIP = {
    "backgroundColor": "#1a2029",
    "borderColor": "#2a323e",
    "textStyle": {"color": "#e4e9f0"},
}
SPLIT_LINE = {"lineStyle": {"color": "rgba(128, 128, 128, 0.25)"}}

ui.echart  # noqa: B018  Registers ECharts.


class Chart(ValueElement, component="chart.js"):  # type: ignore[call-arg]
    """Plots; the value has their options and height, as JSON."""

    VALUE_PROP = "options"

    def __init__(self) -> None:
        self._text = json.dumps(chart([], False))
        super().__init__(value=self._text)
        self._sent_at = -math.inf
        self.on("drawn", self._on_drawn)

    def draw(self, options: dict[str, Any]) -> None:
        """Draw options of ECharts."""
        text = json.dumps(options)
        if text != self._text:
            self._sent_at = time.monotonic()
            self.value = self._text = text

    @property
    def is_drawing(self) -> bool:
        """Whether the browser still draws what it was sent."""
        return time.monotonic() - self._sent_at < ANSWER_LIMIT

    def _on_drawn(self) -> None:
        self._sent_at = -math.inf


class Line(NamedTuple):
    """A line of a plot: its series, by the name that the plot shows, and its color."""

    plot: tuple[str, ...]  #: Key of the plot.
    series: Series
    color: str
    vehicle: str
    field: str


class PlotsPanel:
    """One plot for each unit, or for each field if there are several vehicles, on one time axis."""

    def __init__(self, session: Session):
        self._session = session
        self._lines: list[Line] = []
        self._window = (-SPAN, 0.0)
        asked = context.client.request.query_params.get("plots", "")
        self._ticked = [each for each in asked.split(",") if each] or list(FIRST)
        with ui.element("div").classes("tools"):
            self._name = ui.label().classes("choice")
            self._run = ui.button("Stop", on_click=self._turn).props("outline dense icon=pause")
            for text, act in (("PNG", "png"), ("SVG", "svg")):
                ui.button(text, on_click=lambda act=act: self._picture(act)).props("flat dense")
            ui.button("CSV", on_click=self._table).props("flat dense")
        with ui.expansion("Fields").props("dense").classes("fields"):
            self._tree = ui.tree([], tick_strategy="leaf", on_tick=self._tick)
            self._tree.props("dense no-transition")
        self._nodes: list[dict[str, Any]] = []
        self._chart = Chart()
        self._chart.on("zoom", self._zoom, ["batch", "start", "end"])
        self._figures = ui.table(
            columns=[
                {"name": name, "label": name, "field": name, "align": "left" if k == 0 else "right"}
                for k, name in enumerate(("name", "change", "min", "mean", "max", "deviation"))
            ],
            rows=[],
            row_key="name",
        ).props("dense flat")
        self._figures.set_visibility(False)

    @property
    def is_stopped(self) -> bool:
        """Whether the plots stand still."""
        return self._figures.visible

    def refresh(self, scene: Scene) -> None:
        """Draw the newest numbers, or those before the moment that is shown, unless stopped."""
        if self.is_stopped or self._chart.is_drawing:
            return
        names = self._session.plotted
        self._name.text = ", ".join(names) or "Select a vehicle to see its plots"
        paths = {f"{space(name)}{path}" for name in names for path in self._ticked if "/" in path}
        self._session.dashboard.receive(self._session.page, paths)
        found = self._session.dashboard.plots(self._session.page, self._session.past)
        self._build_tree(names, found)
        self._lines = lines(names, found, self._ticked)
        self._draw()

    def _build_tree(self, names, found):
        known = {series.name for name in names for series in found.get(name, ())}
        nodes = [
            _node(group, [each for each in fields if each in known])
            for group, fields in KNOWN.items()
        ]
        nodes.append(
            _node("log", sorted(known - {each for group in KNOWN.values() for each in group}))
        )
        for topic, fields in self._session.dashboard.fields(names[0]).items() if names else ():
            path = topic.removeprefix(space(names[0]))
            nodes.append(_node(path, [f"{path}/{field}" for field in fields], f"{path}/"))
        nodes = [node for node in nodes if node["children"]]
        if nodes != self._nodes:
            self._nodes = nodes
            self._tree.props["nodes"] = nodes
            self._tree.props["ticked"] = self._ticked

    def _tick(self, event: ValueChangeEventArguments) -> None:
        self._ticked = list(event.value)
        self._session.show_in_address(plots=self._ticked)
        self.refresh(self._session.scene())

    def _picture(self, kind: str) -> None:
        """Let the browser keep a picture of what is seen."""
        self._chart.client.run_javascript(PICTURE % (self._chart.id, json.dumps(kind)))

    def _table(self) -> None:
        """Let the browser keep the numbers that are seen."""
        rows = (
            f"{line.vehicle},{line.field},{line.series.unit},{moment:.3f},{value:.9g}\n"
            for line in self._lines
            for moment, value in zip(line.series.times, line.series.values, strict=True)
            if self._window[0] <= moment <= self._window[1]
        )
        ui.download.content(
            'vehicle,field,unit,"time before what is shown, s",value\n' + "".join(rows),
            "plots.csv",
        )

    def _draw(self) -> None:
        self._chart.draw(chart(self._lines, self.is_stopped))

    def _turn(self) -> None:
        self._figures.set_visibility(not self.is_stopped)
        self._run.text = "Run" if self.is_stopped else "Stop"
        self._run.props(f"icon={'play_arrow' if self.is_stopped else 'pause'}")
        self._window = (-SPAN, 0.0)
        self._draw()
        self._measure()

    def _zoom(self, event: GenericEventArguments) -> None:
        part = (event.args.get("batch") or [event.args])[0]
        self._window = tuple(SPAN * (part[end] / 100 - 1) for end in ("start", "end"))
        self._measure()

    def _measure(self) -> None:
        self._figures.rows = [
            row for line in self._lines if (row := figures(line.series, *self._window)) is not None
        ]
        self._figures.update()


def figures(series: Series, start: float, end: float) -> dict[str, str] | None:
    """Return the figures of a line between two times (s, now is 0); None if there is nothing."""
    times, values = np.asarray(series.times), np.asarray(series.values, dtype=float)
    part = values[(times >= start) & (times <= end) & np.isfinite(values)]
    if not part.size:
        return None
    numbers = {
        "change": part[-1] - part[0],
        "min": part.min(),
        "mean": part.mean(),
        "max": part.max(),
        "deviation": part.std(),
    }
    name = f"{series.name}, {series.unit}" if series.unit else series.name
    return {"name": name, **{what: f"{round(number, 6):z.3g}" for what, number in numbers.items()}}


def points(series: Series) -> list[tuple[float, float | None]]:
    """Return at most `MAX_POINTS` points of a line; a number that is not finite is a gap.

    Rounded to a millionth: an axis that shows rounding errors would hide that nothing moves.
    """
    step = max(1, math.ceil(len(series.times) / MAX_POINTS))
    pairs = zip(series.times[::step], series.values[::step], strict=True)
    return [
        (round(t, 2), round(float(f"{v:.5g}"), 6) if math.isfinite(v) else None) for t, v in pairs
    ]


def space(vehicle: str) -> str:
    """Return the namespace of a vehicle's topics, with a slash at its end."""
    return f"/{vehicle}/".replace("///", "/")


def lines(
    names: Sequence[str], found: Mapping[str, tuple[Series, ...]], ticked: Sequence[str]
) -> list[Line]:
    """Return the lines of what is ticked: those of a unit, or of several vehicles' field, together.

    ``found`` has the series by vehicle, and those of fields, by their whole path, for "".
    """
    paths = {series.name: series for series in found.get("", ())}
    rows = []
    for k, name in enumerate(names):
        own = {series.name: series for series in found.get(name, ())}
        own |= {each: paths[path] for each in ticked if (path := space(name) + each) in paths}
        for field in ticked:
            if (series := own.get(field)) is None:
                continue
            if len(names) > 1:
                plot: tuple[str, ...] = (field,)
                shown, color = name, COLORS[k % len(COLORS)]
            else:
                is_own = series.unit == "deg" or "/" in field
                color = AXES.get(field[-1:] if " " in field or "/" in field else "", "")
                plot, shown = (series.unit, *([field] if is_own else [])), field
            rows.append(Line(plot, replace(series, name=shown), color, name, field))
    order = list(dict.fromkeys(row.plot for row in rows))
    rows.sort(key=lambda row: order.index(row.plot))
    return [
        row if row.color else row._replace(color=COLORS[k % len(COLORS)])
        for k, row in enumerate(rows)
    ]


def chart(shown: Iterable[Line], can_be_measured: bool) -> dict[str, Any]:
    """Return the options of ECharts, and the height (px) of all plots: one for each unit."""
    groups = [list(group) for _, group in groupby(shown, key=lambda line: line.plot)]
    count = len(groups)
    tops = [TOP + k * (HEIGHT + GAP) for k in range(count)]
    zoom = {"type": "inside", "xAxisIndex": list(range(count))}
    return {
        "height": TOP + count * (HEIGHT + GAP) + 10,
        "animation": False,
        "textStyle": DIM,
        "title": [_title(group, top) for group, top in zip(groups, tops, strict=True)],
        "tooltip": {"trigger": "axis", "confine": True, "appendToBody": False, **TOOLTIP},
        "axisPointer": {"link": [{"xAxisIndex": "all"}]},
        "grid": [{"left": 44, "right": 10, "top": top, "height": HEIGHT} for top in tops],
        "xAxis": [
            _axis(k, {"show": k == count - 1, "formatter": "{value} s"}, min=-SPAN, max=0)
            for k in range(count)
        ],
        "yAxis": [_axis(k, {"fontSize": 10}, scale=True, splitNumber=3) for k in range(count)],
        "dataZoom": [zoom] if can_be_measured else [],
        "series": [_line(each, k) for k, group in enumerate(groups) for each in group],
    }


def _title(group: list[Line], top: int) -> dict[str, Any]:
    """Return the names of a plot's lines, each in the color of its line, their field and unit."""
    names = (
        f"{{c{i}|{line.series.name}{'' if len(line.series.times) else ': no message yet'}}}"
        for i, line in enumerate(group)
    )
    rich = {f"c{i}": {"color": line.color, "fontSize": 11} for i, line in enumerate(group)}
    style = {**DIM, "fontSize": 11, "fontWeight": "normal", "rich": rich}
    unit, field = group[0].series.unit, group[0].plot[0]
    what = "" if field in (unit, group[0].series.name) else f"{field}:  "
    text = f"{what}{'  '.join(names)}   {unit}"
    return {"text": text, "top": top - 20, "left": 40, "textStyle": style}


def _axis(plot: int, label: dict[str, Any], **options: Any) -> dict[str, Any]:
    return {
        "type": "value",
        "gridIndex": plot,
        "axisLabel": {**DIM, **label},
        "splitLine": SPLIT_LINE,
        **options,
    }


def _line(line: Line, plot: int) -> dict[str, Any]:
    return {
        "name": line.series.name,
        "type": "line",
        "xAxisIndex": plot,
        "yAxisIndex": plot,
        "data": points(line.series),
        "showSymbol": False,
        "lineStyle": {"width": 1.5},
        "color": line.color,
    }


def _node(label, fields, prefix=""):
    children = [{"id": each, "label": each.removeprefix(prefix)} for each in fields]
    return {"id": f"{label}:", "label": label, "children": children}


#: Keeps the picture of the chart with an id, of a kind: "png" or "svg".
PICTURE = """
const chart = getElement(%s).chart, kind = %s, link = document.createElement("a");
const size = { width: chart.getWidth(), height: chart.getHeight() };
const backgroundColor = getComputedStyle(document.body).backgroundColor;
const { echarts } = await import("nicegui-echart");
const copy = echarts.init(null, null, { renderer: "svg", ssr: true, ...size });
copy.setOption({ ...chart.getOption(), backgroundColor });
const svg = () => new Blob([copy.renderToSVGString()], { type: "image/svg+xml" });
link.href = kind === "svg" ? URL.createObjectURL(svg())
  : chart.getDataURL({ type: "png", pixelRatio: 2, backgroundColor });
link.download = "plots." + kind;
link.click();
"""
