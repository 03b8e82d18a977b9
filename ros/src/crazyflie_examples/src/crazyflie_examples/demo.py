"""Flies the software example from takeoff to landing and reports on the flight."""

import argparse
import contextlib
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

from crazyflie_examples import flight_plot, flight_report
from crazyflie_examples.pilot import FlightError, Pilot
from crazyflie_utils import runner

HOVER = (0.0, 0.0, 1.0)
HOVER_DURATION = 6.0
_END_LIMIT = 15.0


def free_port() -> int:
    """Return a TCP port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextlib.contextmanager
def launched(arguments: list, log: Path):
    """Run roslaunch on a master of its own for the time of a with block.

    Parameters
    ----------
    arguments : list of str
        Package, launch file and its arguments.
    log : Path
        Receives what roslaunch and the nodes print.
    """
    port = free_port()
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    os.environ["ROS_IP"] = "127.0.0.1"
    with log.open("w") as output:
        process = subprocess.Popen(
            ["roslaunch", "-p", str(port), *arguments],
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            yield process
        finally:
            _end(process)


def _end(process):
    for request in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, request)
        try:
            process.wait(_END_LIMIT)
            return
        except subprocess.TimeoutExpired:
            continue


def fly(folder: Path, launch_arguments: list) -> int:
    """Fly, report and return the exit status: 0 for a good flight."""
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / "sw_hover.log"
    rviz = "true" if os.environ.get("DISPLAY") else "false"
    arguments = ["crazyflie_examples", "sw_hover.launch", f"rviz:={rviz}", *launch_arguments]
    print(f"launching {' '.join(arguments)}  (its output: {log})", flush=True)
    with launched(arguments, log):
        print(f"watch it with  export ROS_MASTER_URI={os.environ['ROS_MASTER_URI']}", flush=True)
        try:
            pilot = Pilot(runner.begin("demo_pilot"))
            pilot.wait_until_ready()
            print("rosservice call /takeoff", flush=True)
            pilot.takeoff()
            print(f"hovering for {HOVER_DURATION:g} s", flush=True)
            pilot.hover(HOVER_DURATION)
            print("rosservice call /land", flush=True)
            pilot.land()
        except FlightError as error:
            print(f"the flight failed: {error}; see {log}", file=sys.stderr)
            return 1
    record = pilot.record
    record.save_csv(folder / "sw_hover.csv")
    flight_plot.save(record, HOVER, folder / "sw_hover.png")
    report = flight_report.FlightReport.of(record, HOVER)
    print(report.table())
    print(f"plot: {folder / 'sw_hover.png'}\ndata: {folder / 'sw_hover.csv'}")
    for complaint in report.complaints():
        print(f"bad flight: {complaint}", file=sys.stderr)
    return 1 if report.complaints() else 0


def main() -> int:
    """Fly as the command line asks; return the exit status."""
    parser = argparse.ArgumentParser(prog="run demo", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder for plot, data, log")
    parser.add_argument("launch_arguments", nargs="*", help="such as composed:=true")
    options = parser.parse_args()
    return fly(options.out.resolve(), options.launch_arguments)


if __name__ == "__main__":
    sys.exit(main())
