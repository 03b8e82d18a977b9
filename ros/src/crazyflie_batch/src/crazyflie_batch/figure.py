"""Figure of a Monte-Carlo run."""

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import (
    LogLocator,
    MaxNLocator,
    NullFormatter,
    PercentFormatter,
    StrMethodFormatter,
)

from crazyflie_batch.report import Findings

_GOOD, _BAD, _LINE = "#4477aa", "#cc3311", "#222222"
_COLUMNS = 3


def save_figure(found: Findings, path: Path) -> None:
    """Draw the errors, the sensitivities, and the flights over each parameter."""
    sweeps = found.settings.sweeps
    rows = 1 + math.ceil(len(sweeps) / _COLUMNS)
    figure = Figure(figsize=(4.2 * _COLUMNS, 3.2 * rows), layout="constrained")
    grid = figure.add_gridspec(rows, _COLUMNS)
    _draw_errors(figure.add_subplot(grid[0, :2]), found)
    _draw_sensitivities(figure.add_subplot(grid[0, 2]), found)
    shared = None
    for index, sweep in enumerate(sweeps):
        place = grid[1 + index // _COLUMNS, index % _COLUMNS]
        axes = figure.add_subplot(place, sharey=shared)
        shared = shared or axes
        _draw_parameter(axes, found, sweep, is_first=index % _COLUMNS == 0)
    figure.savefig(path, dpi=120)


def _errors(found):
    """Return the largest errors, m, kept within what can be drawn."""
    error = np.nan_to_num(found.outcomes["largest_error"], nan=1e3)
    return np.clip(error, 1e-4, 1e3)


def _label(axis):
    """Write numbers along a logarithmic axis, also where it does not reach the next power of 10."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


def _draw_errors(axes, found):
    error, limit = _errors(found), found.settings.run.largest_error
    edges = np.geomspace(error.min() / 1.05, error.max() * 1.05, 50)
    good, bad = error[found.is_within], error[~found.is_within]
    axes.hist([good, bad], edges, stacked=True, color=[_GOOD, _BAD], label=["within limits", "not"])
    axes.axvline(limit, color=_LINE, linestyle="--", label=f"limit {limit:g} m")
    axes.set_xscale("log")
    _label(axes.xaxis)
    axes.set_xlabel("largest error after settling, m")
    axes.set_ylabel("flights")
    axes.set_title(f"{len(error)} flights, {found.is_within.mean():.1%} within limits")
    axes.legend()


def _draw_sensitivities(axes, found):
    values = found.sensitivities()
    names = sorted(values, key=lambda name: abs(values[name]))
    axes.barh(names, [values[name] for name in names], color=_GOOD)
    axes.axvline(0.0, color=_LINE, linewidth=0.8)
    axes.set_xlim(-1.0, 1.0)
    axes.set_xlabel("rank correlation with the largest error")
    axes.set_title("sensitivity")


def _draw_parameter(axes, found, sweep, is_first):
    x, y = found.values[sweep.name], _errors(found)
    for chosen, colour in ((found.is_within, _GOOD), (~found.is_within, _BAD)):
        axes.scatter(x[chosen], y[chosen], s=4, color=colour, alpha=0.4, linewidths=0)
    axes.axhline(found.settings.run.largest_error, color=_LINE, linestyle="--", linewidth=0.8)
    axes.set_yscale("log")
    _label(axes.yaxis)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set_xlabel(f"{sweep.name}, {sweep.unit}" if sweep.unit else sweep.name)
    if is_first:
        axes.set_ylabel("largest error, m")
    fractions = axes.twinx()
    fractions.plot(*found.quintiles(sweep.name), color=_LINE, marker="o", markersize=3)
    fractions.set_ylim(0.0, 1.05)
    fractions.yaxis.set_major_formatter(PercentFormatter(1.0))
    fractions.set_ylabel("within limits (line)")
