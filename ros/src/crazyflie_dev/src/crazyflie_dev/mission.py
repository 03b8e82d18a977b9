"""Flies a mission script with simulated vehicles: dry run, flight, report, picture from above.

The vehicles are those of sw_swarm.launch: cf1, cf2, ... in a square on the ground, 1 m apart.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from pathlib import Path

from matplotlib.figure import Figure

from crazyflie_dev.demo import LIMIT, report_recording, wait_for_recording
from crazyflie_dev.fly import LAUNCHED, vehicles_and_arguments
from crazyflie_reports.bag_flights import Flight
from crazyflie_reports.bag_report import PAGE
from crazyflie_reports.flight_operator import FlightError
from crazyflie_utils.testing.launching import LaunchError, complaints, roslaunch

PICTURE = "from_above.png"

START_TIME = 0.2  #: Time that a vehicle takes to start, beside others, on a busy computer (s).
_DEFAULT_COUNT = 5  #: Number of vehicles of a script that names none.


def vehicles_of(script: str) -> int:
    """Return the number of vehicles of a script: the highest k of the names cfk in its text."""
    numbers = [int(number) for number in re.findall(r"\bcf([1-9][0-9]*)\b", script)]
    return max(numbers, default=_DEFAULT_COUNT)


def checked(script: Path) -> str:
    """Return the text of a mission script; ArgumentTypeError if it cannot be one."""
    if script.suffix != ".py":
        raise argparse.ArgumentTypeError(f"{script}: expected a mission script, FILE.py")
    try:
        text = script.read_text()
        compile(text, str(script), "exec")
    except OSError as error:
        raise argparse.ArgumentTypeError(f"{script}: {error.strerror}") from None
    except (SyntaxError, ValueError) as error:
        raise argparse.ArgumentTypeError(f"{script} is not a Python script: {error}") from None
    return text


def fly(script: list[str], names: list[str], folder: Path, launch_arguments: list[str]) -> int:
    """Fly a script (path and its arguments) with vehicles; return the exit status."""
    folder.mkdir(parents=True, exist_ok=True)
    log, recordings = folder / "swarm.log", folder / "recordings"
    rviz = "true" if os.environ.get("DISPLAY") else "false"
    # In simulated time at real speed: on a busy computer the flight is slower, but as good. At full
    # speed, the recording would lack messages.
    arguments = [
        *(*LAUNCHED, f"n:={len(names)}", "sim_time:=true", f"rviz:={rviz}"),
        *("record:=true", f"record_folder:={recordings}"),
        *launch_arguments,
    ]
    print(f"launching {' '.join(arguments)}  (its output: {log})", flush=True)
    begin = time.monotonic()
    with roslaunch(arguments, log):
        wait_for_recording(f"/{names[-1]}/state", LIMIT + START_TIME * len(names))
        command = [sys.executable, "-m", "crazyflie_mission_api.mission_runner", "fly", *script]
        with subprocess.Popen(command) as process:
            try:
                status = process.wait()
            except KeyboardInterrupt:
                # The script lands its vehicles first.
                status = process.wait()
    passed = f"{time.monotonic() - begin:.0f} s"
    if status:
        print(f"the script failed after {passed}", file=sys.stderr)
        print(*complaints(log), sep="\n", file=sys.stderr)
    else:
        print(f"flown in {passed}", flush=True)
    page, flights = report_recording(recordings, folder)
    draw_from_above(flights).savefig(folder / PICTURE, dpi=150)
    print(page.table())
    print(f"report: {folder / PAGE}\npicture: {folder / PICTURE}")
    return status


def draw_from_above(flights: list[Flight]) -> Figure:
    """Return a figure of the paths in x and y (m); a circle is a start, a cross an end."""
    figure = Figure(figsize=(6.4, 6.4), layout="constrained")
    axes = figure.add_subplot(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    for flight in flights:
        x, y = flight.record.state.column("x"), flight.record.state.column("y")
        (line,) = axes.plot(x, y, linewidth=1.0, label=flight.vehicle.name)
        axes.plot(x[:1], y[:1], "o", color=line.get_color())
        axes.plot(x[-1:], y[-1:], "x", color=line.get_color())
    axes.grid(visible=True, linewidth=0.3)
    if 0 < len(flights) <= 12:
        axes.legend(fontsize="small")
    return figure


def main() -> int:
    """Fly the script on the command line; return the exit status."""
    arguments = sys.argv[1:]
    # Arguments behind -- belong to the script.
    cut = arguments.index("--") if "--" in arguments else len(arguments)
    parser = argparse.ArgumentParser(prog="run mission", description=__doc__)
    parser.add_argument("script", type=Path, metavar="FILE.py", help="see crazyflie_mission_api")
    parser.add_argument("words", nargs="*", metavar="n|NAME:=VALUE",
                        help="number of vehicles, arguments of sw_swarm.launch such as "
                        "spacing:=1.8; n is by default the highest of the names cf1, cf2, ... in "
                        f"the script, or {_DEFAULT_COUNT}")  # fmt: skip
    parser.add_argument("--out", type=Path, help="folder for report, picture, log (out/NAME)")
    options = parser.parse_intermixed_args(arguments[:cut])
    script = options.script
    try:
        text = checked(script)
        names, launch_arguments = vehicles_and_arguments(options.words, vehicles_of(text))
    except argparse.ArgumentTypeError as error:
        parser.error(str(error))
    folder = (options.out or Path("out") / script.stem).resolve()
    try:
        return fly([str(script), *arguments[cut + 1 :]], names, folder, launch_arguments)
    except (LaunchError, FlightError) as error:
        print(error, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
