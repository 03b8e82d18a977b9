"""Flies the demo and draws two pictures of it for the manual.

``docs/images/demo.svg`` is an animation: the terminal, and the vehicle on its path.
``docs/images/flight_report.png`` is the top of the report, in headless Chromium.
"""

import argparse
import subprocess
import sys
import textwrap
import time
from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from crazyflie_reports.bag_report import PAGE

IMAGES = Path(__file__).resolve().parents[5] / "docs" / "images"

_REPORT_SIZE = (1200, 872)
_CHROMIUM_LIMIT = 60.0  #: Timeout of Chromium (s).
_TAKEOFF = "rosservice call /takeoff"  #: The line that the demo prints when it takes off.

WIDTH, HEIGHT = 1000, 420
_COLUMNS = 62  #: Characters in a line of the terminal.
_BEFORE, _AFTER = 1.5, 4.0  #: Time before the takeoff and after the last line (s).
_RATE = 12.5  #: Points of the animated path, Hz.
_SCALE = 170.0  #: Pixels of a metre.
_ORIGIN = (775.0, 310.0)  #: Pixel of the place (0, 0, 0).
_FLOOR = 0.75  #: Half the width of the floor, m.

#: A line of the terminal, with the time at which it is printed, s.
Line = tuple[float, str]


def projected(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pixels, shape (n, 2), of positions (m), shape (n, 3), in a view."""
    x, y, z = positions.T
    right = 0.87 * (x - y)
    up = 0.35 * (x + y) + z
    return np.column_stack([_ORIGIN[0] + _SCALE * right, _ORIGIN[1] - _SCALE * up])


def timed(lines: Sequence[Line]) -> list[Line]:
    """Return the lines with their times in the animation: the start of the launch is shortened.

    `ValueError`: the vehicle has not taken off.
    """
    takeoff = next((moment for moment, text in lines if text == _TAKEOFF), None)
    if takeoff is None:
        raise ValueError("the demo has not taken off")
    before = sum(moment < takeoff for moment, _ in lines)
    starts = [*np.linspace(0.0, _BEFORE, before, endpoint=False)]
    starts += [moment - takeoff + _BEFORE for moment, _ in lines[before:]]
    return [(start, text) for start, (_, text) in zip(starts, lines, strict=True)]


def animation(lines: Sequence[Line], flight: NDArray[np.float64]) -> str:
    """Return the animated SVG of `timed` lines and a flight: time (s), x, y, z (m), shape (n, 4).

    The flight's time 0 is its takeoff.
    """
    duration = lines[-1][0] + _AFTER
    moments = np.arange(0.0, duration, 1.0 / _RATE)
    columns = [np.interp(moments - _BEFORE, flight[:, 0], column) for column in flight.T[1:]]
    positions = np.column_stack(columns)
    path, shadow = projected(positions), projected(positions * (1.0, 1.0, 0.0))
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    repeat = f'dur="{duration:.1f}s" repeatCount="indefinite"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}"'
        f' height="{HEIGHT}" font-family="sans-serif" font-size="14">',
        "<title>./run demo: what the terminal prints, and the vehicle on its path</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" rx="8" fill="#1b1f27"/>',
        '<g font-family="monospace" font-size="13" fill="#cfd8dc">',
        f'<text x="20" y="30" fill="#66bb6a">{escape("$ ./run demo")}</text>',
    ]
    row = 1
    for start, text in lines:
        shown = f'<animate attributeName="opacity" values="0;1" keyTimes="0;{start / duration:.4f}"'
        shown = f'{shown} calcMode="discrete" {repeat}/>' if start else ""
        for piece in textwrap.wrap(text, _COLUMNS, replace_whitespace=False):
            place = f'x="20" y="{30 + 19 * row}" xml:space="preserve"'
            parts.append(f"<text {place}>{escape(piece)}{shown}</text>")
            row += 1
    floor = [
        projected(np.array([[a, -_FLOOR, 0], [a, _FLOOR, 0], [-_FLOOR, a, 0], [_FLOOR, a, 0]]))
        for a in np.linspace(-_FLOOR, _FLOOR, 4)
    ]
    grid = " ".join(f"M{_points(ends[:2])}M{_points(ends[2:])}" for ends in floor)
    offsets = ";".join(f"{lengths[-1] - length:.0f}" for length in lengths)
    parts += [
        "</g>",
        f'<path d="{grid}" stroke="#3a414d" fill="none"/>',
        f'<polyline points="{_points(path)}" fill="none" stroke="#4fc3f7" stroke-width="2"'
        f' stroke-dasharray="{lengths[-1]:.0f}"><animate attributeName="stroke-dashoffset"'
        f' values="{offsets}" {repeat}/></polyline>',
        f'<ellipse rx="14" ry="6" fill="#000" opacity="0.5">{_motion(shadow, repeat)}</ellipse>',
        '<g stroke="#eceff1" stroke-width="2" fill="#ff7043">'
        '<path d="M-12 -5 12 5M-12 5 12 -5"/><circle r="4" stroke="none"/>'
        '<g fill="none" stroke-width="1.5"><ellipse cx="-12" cy="-5" rx="8" ry="3"/>'
        '<ellipse cx="12" cy="-5" rx="8" ry="3"/><ellipse cx="-12" cy="5" rx="8" ry="3"/>'
        f'<ellipse cx="12" cy="5" rx="8" ry="3"/></g>{_motion(path, repeat)}</g>',
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _points(pixels):
    return " ".join(f"{x:.0f},{y:.0f}" for x, y in pixels)


def _motion(pixels, repeat):
    values = _points(pixels).replace(" ", ";")
    return (
        f'<animateTransform attributeName="transform" type="translate" values="{values}" {repeat}/>'
    )


def fly(folder: Path) -> list[Line]:
    """Fly the demo into a folder; return its output, without the names of folders above.

    `subprocess.CalledProcessError`: the flight failed.
    """
    command = [sys.executable, "-u", "-m", "crazyflie_dev.demo", "--out", str(folder)]
    begin = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = [
            (time.monotonic() - begin, text.rstrip().replace(f"{folder.parent}/", ""))
            for text in process.stdout
        ]
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return lines


def render_report(page: Path, output: Path, moment: float) -> None:
    """Draw the top of a report as it is at a moment (s) of the replay, into a PNG file."""
    command = ["chromium", "--headless", "--no-sandbox", "--hide-scrollbars"]
    width, height = _REPORT_SIZE
    command += [f"--window-size={width},{height}", f"--screenshot={output}"]
    address = f"{page.resolve().as_uri()}#{moment}"
    subprocess.run([*command, address], check=True, timeout=_CHROMIUM_LIMIT)


def main() -> int:
    """Fly and draw as the command line asks; return the exit status."""
    parser = argparse.ArgumentParser(prog="render_demo", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the flight")
    parser.add_argument("--images", type=Path, default=IMAGES, help="folder (%(default)s)")
    parser.add_argument(
        "--time", type=float, default=12.2, help="moment of the replay, s (%(default)s)"
    )
    options = parser.parse_args()
    folder = options.out.resolve()
    try:
        lines = timed(fly(folder))
        flight = np.genfromtxt(folder / "sw_hover.csv", delimiter=",", names=True)
        took_off = flight["time"][np.argmax(flight["z"] > 0.005)]
        columns = [flight["time"] - took_off, flight["x"], flight["y"], flight["z"]]
        (options.images / "demo.svg").write_text(animation(lines, np.column_stack(columns)))
        render_report(folder / PAGE, options.images / "flight_report.png", options.time)
    except FileNotFoundError as error:
        print(f"{error.filename} does not exist (Debian package chromium?)", file=sys.stderr)
        return 1
    except (subprocess.SubprocessError, ValueError) as error:
        print(f"no picture: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
