"""Visualizers of --sim: none, or matplotlib, in a window or for a video."""

import logging
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from crazyflie_py.simulated_vehicle import SimulatedVehicle
from crazyflie_py.swarm import NullVisualizer
from crazyflie_utils.text_file import user_path

_log = logging.getLogger(__name__)

_ROOM = ((-5.0, 5.0), (-5.0, 5.0), (0.0, 3.0))  #: Displayed limits of x, y and z (m).

_DOTS_PER_INCH = 100

_LINE_COLOR = (0.3, 0.3, 0.3)

_POINT_SIZE = 60  #: Area of a vehicle, in squared typographic points.
_POINTS = 24  #: Number of points of each of the three circles of an ellipsoid.


class MatplotlibVisualizer(NullVisualizer):
    """Draws vehicles as points in the colours of their LEDs.

    Without a window, pictures are drawn for videos only, which needs no display.
    """

    def __init__(self, has_window: bool):
        self._pyplot: Any = None
        self._writer: Any = None
        self._frames = 0
        self._edges: list[tuple[int, int]] = []
        self._radii: Any = None
        self._figure: Any = self._window() if has_window else None
        self._axes: Any = None if self._figure is None else _axes(self._figure)
        self._artists: list[Any] = []

    def _window(self):
        """Return the figure in a window; None if no window can be opened."""
        try:
            # Imported here, since it takes as long as all other imports.
            from matplotlib import pyplot

            figure = pyplot.figure()
            # If no toolkit finds the display, matplotlib draws without a window.
            if figure.canvas.required_interactive_framework is None:
                raise RuntimeError(f"matplotlib has chosen {pyplot.get_backend()}")
        except Exception as error:
            # Depends on the toolkit: ImportError, TclError, RuntimeError and others.
            _log.warning("--vis: no window can be opened (%s); nothing is drawn", error)
            return None
        self._pyplot = pyplot
        return figure

    def setGraph(self, edges: Sequence[tuple[int, int]]) -> None:
        """Draw lines between vehicles, given by their numbers."""
        self._edges = list(edges)

    def showEllipsoids(self, radii: Sequence[float]) -> None:
        """Draw an ellipsoid around each vehicle, radii in m."""
        angles = np.linspace(0.0, 2.0 * np.pi, _POINTS)
        circle = np.array([np.cos(angles), np.sin(angles), np.zeros(_POINTS)])
        circles = [np.roll(circle, shift, axis=0).T for shift in range(3)]
        self._radii = np.array(circles) * np.asarray(radii, dtype=float)

    def startVideoOutput(self, path: str, dt: float) -> None:
        """Write a video, a frame each ``dt`` (s); without ffmpeg an animated gif."""
        from matplotlib.animation import FFMpegWriter, PillowWriter
        from matplotlib.figure import Figure

        target = user_path(path)
        if not target.parent.is_dir():
            raise ValueError(f"--video: {path}: the folder {target.parent} does not exist")
        writer = FFMpegWriter
        if target.suffix != ".gif" and not FFMpegWriter.isAvailable():
            target = target.with_suffix(".gif")
            _log.warning("--video: ffmpeg is not installed; %s is written instead", target)
        if target.suffix == ".gif":
            writer = PillowWriter
        if self._figure is None:
            self._figure = Figure()
            self._axes = _axes(self._figure)
        self._writer = writer(fps=1.0 / dt)
        self._frames = 0
        self._writer.setup(self._figure, str(target), _DOTS_PER_INCH)

    def finishVideoOutput(self) -> None:
        """End the video, if there is one."""
        writer, self._writer = self._writer, None
        if writer is not None and self._frames > 0:
            writer.finish()

    def update(self, t: float, crazyflies: Sequence[SimulatedVehicle]) -> None:
        """Draw vehicles at a time, s."""
        is_open = self._pyplot is not None and self._pyplot.fignum_exists(self._figure.number)
        if not is_open and self._writer is None:
            return
        self._draw(t, crazyflies)
        if is_open:
            self._pyplot.pause(1e-3)
        if self._writer is not None:
            self._writer.grab_frame()
            self._frames += 1

    def _draw(self, t, crazyflies):
        from mpl_toolkits.mplot3d.art3d import Line3DCollection

        for artist in self._artists:
            artist.remove()
        positions = np.array([vehicle.motion.position for vehicle in crazyflies])
        colors = [vehicle.parameters.led_color for vehicle in crazyflies]
        lines = [positions[list(edge)] for edge in self._edges]
        if self._radii is not None:
            lines += [position + circle for position in positions for circle in self._radii]
        self._axes.set_title(f"{t:.2f} s")
        self._artists = [
            self._axes.scatter(*positions.T, c=colors, s=_POINT_SIZE, depthshade=False),
            # add_collection3d of matplotlib 3.10 fails without lines or with different lengths.
            self._axes.add_collection(Line3DCollection(lines, colors=_LINE_COLOR), autolim=False),
        ]


def _axes(figure):
    axes = figure.add_subplot(projection="3d")
    for name, limits in zip("xyz", _ROOM, strict=True):
        getattr(axes, f"set_{name}lim")(limits)
        getattr(axes, f"set_{name}label")(f"{name} / m")
    return axes


def visualizer_for(name: str, has_video: bool) -> NullVisualizer:
    """Return the visualizer of a name of --vis; a video is written by any of them.

    Without a display there is no window.
    """
    if name == "null" and not has_video:
        return NullVisualizer()
    if name == "vispy":
        _log.warning("--vis vispy: not available here; matplotlib draws")
    has_display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return MatplotlibVisualizer(has_display and name in ("mpl", "vispy"))
