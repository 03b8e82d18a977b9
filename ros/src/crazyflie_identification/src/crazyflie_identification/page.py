"""The page of a fit: figures with their errors, and measured against predicted poses."""

import html
import math

import numpy as np
from numpy.typing import NDArray

from crazyflie_identification.fit import Fit, fitted, residuals
from crazyflie_model.quadrotor import QuadrotorParameters

_WIDTH, _HEIGHT, _POINTS = 860, 150, 600
_AXES = (("x", "m", 1.0), ("y", "m", 1.0), ("z", "m", 1.0),
         ("roll", "deg", 180.0 / math.pi), ("pitch", "deg", 180.0 / math.pi),
         ("yaw", "deg", 180.0 / math.pi))  # fmt: skip

_STYLE = """
body { font: 15px/1.4 sans-serif; max-width: 900px; margin: 2em auto; color: #222; }
pre { background: #f4f4f4; padding: .8em; }
svg { background: #fafafa; display: block; margin-bottom: .3em; }
.measured { stroke: #1f77b4; } .predicted { stroke: #d62728; }
polyline { fill: none; stroke-width: 1.2; }
"""


def page(fit: Fit, kind: QuadrotorParameters, title: str) -> str:
    """Return a page of HTML with plots of the part of the flight that was not used."""
    part = fit.unused
    predicted = fitted(fit.values, kind, fit.thrust, part)
    used, unused = (
        residuals(fit.values, kind, fit.thrust, each).std(axis=0) for each in (fit.used, part)
    )
    rows = "".join(
        f"<tr><td>{name}</td><td>{factor * a:.4g}</td><td>{factor * b:.4g}</td><td>{unit}</td></tr>"
        for (name, unit, factor), a, b in zip(_AXES, used, unused, strict=True)
    )
    plots = "".join(
        f"<h3>{name} ({unit})</h3>"
        + _plot(part.pose_times, factor * part.poses[:, k], factor * predicted[:, k])
        for k, (name, unit, factor) in enumerate(_AXES)
    )
    return (
        f"<!doctype html><html lang='en'><meta charset='utf-8'><title>{html.escape(title)}</title>"
        f"<style>{_STYLE}</style><h1>{html.escape(title)}</h1>"
        "<p>Figures of the vehicle with their standard errors:</p>"
        f"<pre>{html.escape(chr(10).join(fit.lines()))}</pre>"
        "<p>Measured minus predicted, root mean square: if the part that was not used has much "
        "more than the one that was, the model does not describe the vehicle.</p>"
        "<table border='1' cellpadding='4'>"
        "<tr><th></th><th>used</th><th>not used</th><th></th></tr>"
        f"{rows}</table>"
        "<h2>The part that was not used</h2><p>Measured blue, predicted red; position, velocity "
        f"and heading start again every 3 s.</p>{plots}</html>"
    )


def _plot(times: NDArray[np.float64], *series: NDArray[np.float64]) -> str:
    low = min(float(each.min()) for each in series)
    high = max(float(each.max()) for each in series)
    pad = max(0.05 * (high - low), 1e-6)
    low, high = low - pad, high + pad
    every = max(1, len(times) // _POINTS)
    lines = []
    for values, kind in zip(series, ("measured", "predicted"), strict=True):
        x = (times[::every] - times[0]) / (times[-1] - times[0]) * _WIDTH
        y = (high - values[::every]) / (high - low) * _HEIGHT
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        lines.append(f"<polyline class='{kind}' points='{points}'/>")
    seconds = times[-1] - times[0]
    return (
        f"<svg width='{_WIDTH}' height='{_HEIGHT + 18}'>{''.join(lines)}"
        f"<text x='2' y='12' font-size='11'>{high:.3g}</text>"
        f"<text x='2' y='{_HEIGHT - 2}' font-size='11'>{low:.3g}</text>"
        f"<text x='{_WIDTH - 40}' y='{_HEIGHT + 14}' font-size='11'>{seconds:.0f} s</text></svg>"
    )
