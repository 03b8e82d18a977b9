"""Plots of the last minute of one vehicle, that can be stopped and measured."""

import math
from collections.abc import Iterable
from itertools import groupby
from typing import Any

import numpy as np
from nicegui import ui
from nicegui.events import GenericEventArguments

from crazyflie_dashboard.page.session import Session
from crazyflie_dashboard.page_data import Series
from crazyflie_dashboard.snapshot import Scene

SPAN = 60.0  #: Time that is shown (s).
MAX_POINTS = 300  #: Largest number of points of a line: the plot has no pixels for more.
HEIGHT, GAP, TOP = 105, 34, 26  #: Height of a plot, space between two and above the first (px).

COLORS = ["#4ea1ff", "#35c98a", "#ffb545", "#ff6b6b", "#b58cff", "#5fd3e0"]

DIM = {"color": "#93a0b2"}  #: Style of texts in the plots.
SPLIT_LINE = {"lineStyle": {"color": "#2a323e"}}
NAME_STYLES = {f"c{i}": {"color": color, "fontSize": 11} for i, color in enumerate(COLORS)}


class PlotsPanel:
    """One plot for each unit, one below the other, with a common time axis."""

    def __init__(self, session: Session):
        self._session = session
        self._series: tuple[Series, ...] = ()
        self._window = (-SPAN, 0.0)
        with ui.element("div").classes("tools"):
            self._name = ui.label().classes("choice")
            self._run = ui.button("Stop", on_click=self._turn).props("outline dense icon=pause")
        with ui.element("div").classes("tools"):
            self._field = ui.input("another field, as /cf1/pose/pose/position/x")
            self._field.props("dense outlined").classes("number")
            ui.button("Add", on_click=self._add).props("outline")
        self._fields: list[str] = []
        self._chips = ui.element("div")
        self._chart = ui.echart({"series": []}, theme=None).classes("chart")
        self._chart.on("chart:datazoom", self._zoom, ["batch", "start", "end"])
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
        """Draw the newest numbers, unless stopped."""
        if self.is_stopped:
            return
        self._name.text = self._session.watched or "Choose a vehicle to see its plots"
        self._series = self._session.dashboard.plots(self._session.page)
        self._draw()
        # Only fields have the path of a topic as name; a page that reconnects has none.
        fields = [each.name for each in self._series if each.name.startswith("/")]
        if fields != self._fields:
            self._fields = fields
            self._build_chips()

    def _build_chips(self) -> None:
        self._chips.clear()
        with self._chips:
            for path in self._fields:
                chip = ui.chip(path, removable=True).props("dense outline")
                chip.on_value_change(lambda path=path: self._remove(path))

    def _remove(self, path: str) -> None:
        self._session.dashboard.remove_field(self._session.page, path)

    def _draw(self) -> None:
        options = chart(self._series, self.is_stopped)
        self._chart.style(f"height: {options.pop('height')}px")
        if self._chart.options == options:
            return
        self._chart.options.clear()
        self._chart.options.update(options)
        self._chart.update()

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
            row for each in self._series if (row := figures(each, *self._window)) is not None
        ]
        self._figures.update()

    async def _add(self) -> None:
        path = (self._field.value or "").strip()
        done = self._session.dashboard.add_field(self._session.page, path)
        if await self._session.succeeds(done):
            self._field.value = ""


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


def chart(series: Iterable[Series], can_be_measured: bool) -> dict[str, Any]:
    """Return the options of ECharts, and the height (px) of all plots: one for each unit."""
    groups = [list(group) for _, group in groupby(series, key=_plot)]
    count = len(groups)
    tops = [TOP + k * (HEIGHT + GAP) for k in range(count)]
    zoom = {"type": "inside", "xAxisIndex": list(range(count))}
    return {
        "height": TOP + count * (HEIGHT + GAP) + 10,
        "animation": False,
        "textStyle": DIM,
        "title": [_title(group, top) for group, top in zip(groups, tops, strict=True)],
        "tooltip": {"trigger": "axis", "confine": True, "appendToBody": False},
        "axisPointer": {"link": [{"xAxisIndex": "all"}]},
        "grid": [{"left": 44, "right": 10, "top": top, "height": HEIGHT} for top in tops],
        "xAxis": [
            _axis(k, {"show": k == count - 1, "formatter": "{value} s"}, min=-SPAN, max=0)
            for k in range(count)
        ],
        "yAxis": [_axis(k, {"fontSize": 10}, scale=True, splitNumber=3) for k in range(count)],
        "dataZoom": [zoom] if can_be_measured else [],
        "series": [
            _line(each, k, COLORS[i % len(COLORS)])
            for k, group in enumerate(groups)
            for i, each in enumerate(group)
        ],
    }


def _plot(series: Series) -> tuple[str, str]:
    """Return the key of a line's plot: its unit, or for an angle its name."""
    return series.unit, series.name if series.unit == "deg" else ""


def _title(group: list[Series], top: int) -> dict[str, Any]:
    """Return the names of a plot's lines, each in the color of its line, and their unit."""
    names = (
        f"{{c{i % len(COLORS)}|{each.name}{'' if len(each.times) else ': no message yet'}}}"
        for i, each in enumerate(group)
    )
    style = {**DIM, "fontSize": 11, "fontWeight": "normal", "rich": NAME_STYLES}
    text = f"{'  '.join(names)}   {group[0].unit}"
    return {"text": text, "top": top - 20, "left": 40, "textStyle": style}


def _axis(plot: int, label: dict[str, Any], **options: Any) -> dict[str, Any]:
    return {
        "type": "value",
        "gridIndex": plot,
        "axisLabel": {**DIM, **label},
        "splitLine": SPLIT_LINE,
        **options,
    }


def _line(series: Series, plot: int, color: str) -> dict[str, Any]:
    return {
        "name": series.name,
        "type": "line",
        "xAxisIndex": plot,
        "yAxisIndex": plot,
        "data": points(series),
        "showSymbol": False,
        "lineStyle": {"width": 1.5},
        "color": color,
    }
