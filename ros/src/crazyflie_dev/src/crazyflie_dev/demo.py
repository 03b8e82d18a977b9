"""Flies the software example from takeoff to landing and reports on the flight."""

import argparse
import os
import sys
from pathlib import Path

from crazyflie_reports import flight_plot, flight_report
from crazyflie_reports.flight_operator import FlightError, FlightOperator
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import LaunchError, complaints, roslaunch

HOVER = (0.0, 0.0, 1.0)
HOVER_DURATION = 6.0
LIMIT = 30.0
"""The longest that a part of the flight may take, s; a takeoff takes six."""


def fly(folder: Path, launch_arguments: list[str]) -> int:
    """Fly, report and return the exit status: 0 for a good flight."""
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "sw_hover.log"
    rviz = "true" if os.environ.get("DISPLAY") else "false"
    arguments = ["crazyflie_examples", "sw_hover.launch", f"rviz:={rviz}", *launch_arguments]
    print(f"launching {' '.join(arguments)}  (its output: {log})", flush=True)
    with roslaunch(arguments, log):
        print(f"watch it with  export ROS_MASTER_URI={os.environ['ROS_MASTER_URI']}", flush=True)
        try:
            operator = FlightOperator(begin("demo"), limit=LIMIT)
            operator.wait_until_ready()
            print("rosservice call /takeoff", flush=True)
            operator.takeoff()
            print(f"hovering for {HOVER_DURATION:g} s", flush=True)
            operator.hover(HOVER_DURATION)
            print("rosservice call /land", flush=True)
            operator.land()
        except FlightError as error:
            print(f"the flight failed: {error}; see {log}", file=sys.stderr)
            print(*complaints(log), sep="\n", file=sys.stderr)
            return 1
    record = operator.finish()
    record.save_csv(folder / "sw_hover.csv")
    flight_plot.save(record, HOVER, folder / "sw_hover.png")
    report = flight_report.FlightReport.of(record, HOVER)
    print(report.table())
    print(f"plot: {folder / 'sw_hover.png'}\ndata: {folder / 'sw_hover.csv'}")
    if not report.complaints():
        return 0
    for complaint in report.complaints():
        print(f"bad flight: {complaint}", file=sys.stderr)
    print(*complaints(log), sep="\n", file=sys.stderr)
    return 1


def main() -> int:
    """Fly as the command line asks; return the exit status."""
    parser = argparse.ArgumentParser(prog="run demo", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for plot, data, log")
    parser.add_argument("launch_arguments", nargs="*", help="such as composed:=true")
    options = parser.parse_args()
    try:
        return fly(options.out.resolve(), options.launch_arguments)
    except LaunchError as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
