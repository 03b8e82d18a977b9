"""The page of a fit: figures with their errors, and measured against predicted poses."""

import html
import io
import math

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from crazyflie_identification.fit import Fit, Recording, fitted, residuals
from crazyflie_model.quadrotor import QuadrotorParameters

_AXES = (("x", "m", 1.0), ("y", "m", 1.0), ("z", "m", 1.0),
         ("roll", "deg", 180.0 / math.pi), ("pitch", "deg", 180.0 / math.pi),
         ("yaw", "deg", 180.0 / math.pi))  # fmt: skip

_STYLE = """
body { font: 15px/1.4 sans-serif; max-width: 900px; margin: 2em auto; color: #222; }
pre { background: #f4f4f4; padding: .8em; }
svg { width: 100%; height: auto; }
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
        "<h2>The part that was not used</h2><p>Position, velocity and heading start "
        f"again every 3 s.</p>{_plots(part, predicted)}</html>"
    )


def _plots(part: Recording, predicted: NDArray[np.float64]) -> str:
    """Return measured and predicted poses over time, as SVG."""
    figure = Figure(figsize=(9.0, 13.0), layout="constrained")
    seconds = part.pose_times - part.pose_times[0]
    for k, (axes, (name, unit, factor)) in enumerate(zip(figure.subplots(6), _AXES, strict=True)):
        for label, poses in (("measured", part.poses), ("predicted", predicted)):
            curve = factor * poses[:, k]
            axes.plot(seconds, curve, linewidth=1.0, label=label, gid=f"{label} {name}")
        axes.set(ylabel=f"{name} ({unit})", xlabel="time (s)")
        axes.grid(alpha=0.4)
    figure.axes[0].legend()
    picture = io.StringIO()
    figure.savefig(picture, format="svg")
    # Before it are declarations of a file.
    return picture.getvalue()[picture.getvalue().index("<svg") :]
