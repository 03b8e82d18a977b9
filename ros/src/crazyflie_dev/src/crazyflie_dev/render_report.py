"""Draws docs/images/flight_report.png: a report, such as the demo's, in headless Chromium."""

import argparse
import subprocess
import sys
from pathlib import Path

from crazyflie_reports.bag_report import PAGE

PICTURE = Path(__file__).resolve().parents[5] / "docs" / "images" / "flight_report.png"

WIDTH, HEIGHT = 1200, 872

_LIMIT = 60.0  #: The longest that Chromium may take, s.


def render(page: Path, output: Path, moment: float) -> None:
    """Draw the top of a report as it is at a moment (s) of the replay, into a PNG file."""
    command = ["chromium", "--headless", "--no-sandbox", "--hide-scrollbars"]
    command += [f"--window-size={WIDTH},{HEIGHT}", f"--screenshot={output}"]
    subprocess.run([*command, f"{page.resolve().as_uri()}#{moment}"], check=True, timeout=_LIMIT)


def main() -> int:
    """Render as the command line asks; return the exit status."""
    parser = argparse.ArgumentParser(prog="render_report", description=__doc__)
    parser.add_argument("page", nargs="?", type=Path, default=Path("out") / PAGE)
    parser.add_argument("--output", type=Path, default=PICTURE, help="PNG file (%(default)s)")
    parser.add_argument("--time", type=float, default=12.2, help="of the replay, s (%(default)s)")
    options = parser.parse_args()
    if not options.page.exists():
        print(f"there is no {options.page}; ./run demo makes one", file=sys.stderr)
        return 1
    try:
        render(options.page, options.output.absolute(), options.time)
    except FileNotFoundError:
        print("chromium is not installed (Debian package chromium)", file=sys.stderr)
        return 1
    except subprocess.SubprocessError as error:
        print(f"no picture: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
