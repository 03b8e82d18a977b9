"""Flies the software example from takeoff to landing and reports on the flight."""

import argparse
import os
import shutil
import sys
import tempfile
import time
from pathlib import Path

import rosgraph

from crazyflie_demo import figure8
from crazyflie_msgs.msg import PositionVelocityYawState, PositionVelocityYawStateStamped
from crazyflie_reports import bag_log, bag_report
from crazyflie_reports.bag_flights import Flight, flights
from crazyflie_reports.flight_operator import FlightError, FlightOperator
from crazyflie_reports.flight_record import FlightReport
from crazyflie_utils.main import begin
from crazyflie_utils.terminal import waiting
from crazyflie_utils.testing.launching import LaunchError, complaints, roslaunch

HOVER = (0.0, 0.0, 1.0)
HOVER_DURATION = 2.2
HOVER_WINDOW = 2.0  #: Time before the figure eight over which the hover error is measured (s).

EIGHT_DURATION = 6.0
#: Scale of `crazyflie_demo.figure8`: the whole figure would need, in this time, the full tilt of 15
#: degrees that a control may have.
EIGHT_SCALE = 0.8
#: Period of the controller, so that its reference moves as its state does (s).
REFERENCE_PERIOD = 0.01

SETTLING = 0.5  #: Time from the end of the figure eight to the landing (s).

LAUNCH_FILE = ("crazyflie_examples", "sw_controller.launch")
#: The controller of the examples that follows a yaw, and the model in which it matters.
ARGUMENTS = ("controller:=position_velocity_yaw", "dynamics:=coupled_7d", "record:=true")

REFERENCE, STATUS = "/ref/position_velocity_yaw", "/in_flight_flight_status"

LIMIT = 30.0  #: Timeout of a part of the flight (s); a takeoff takes 6 s.


def eight(moment: float) -> PositionVelocityYawState:
    """Return the reference of the figure eight, which turns once, at a time (s) since its begin."""
    rate = figure8.DURATION / EIGHT_DURATION
    x = figure8.sine(EIGHT_SCALE * figure8.WIDTH, 1, rate * moment)
    y = figure8.sine(EIGHT_SCALE * figure8.HEIGHT, 2, rate * moment)
    turn = figure8.phase(rate * moment)
    return PositionVelocityYawState(
        x=x[0], y=y[0], z=HOVER[2], x_dot=rate * x[1], y_dot=rate * y[1], yaw=turn[0]
    )


def say_if_busy(load: float, processors: int) -> None:
    """Warn if the load (running and waiting programs) is too high for a flight in real time."""
    if load > processors:
        print(
            f"this computer is too busy: {load:.1f} programs share its {processors} processors, "
            "and the flight may be bad; ./run demo sim_time:=true real_time_factor:=0 does not "
            "depend on that",
            file=sys.stderr,
        )


def fly_and_land() -> None:
    """Fly on the running master."""
    process = begin("demo")
    handle = process.handle("/figure_eight")
    references = handle.publisher(REFERENCE, PositionVelocityYawStateStamped)
    operator = FlightOperator(process, limit=LIMIT)
    operator.wait_until_ready()
    print("rosservice call /takeoff", flush=True)
    operator.takeoff()
    print(f"hovering for {HOVER_DURATION:g} s", flush=True)
    operator.hover(HOVER_DURATION)
    print(f"a figure eight of {EIGHT_DURATION:g} s", flush=True)
    start = operator.time
    moment = 0.0
    while moment < EIGHT_DURATION:
        operator.hover(REFERENCE_PERIOD)
        moment = min(operator.time - start, EIGHT_DURATION)
        message = PositionVelocityYawStateStamped(state=eight(moment))
        message.header.stamp = handle.stamp()
        references.publish(message)
    operator.hover(SETTLING)
    print("rosservice call /land", flush=True)
    operator.land()


def fly(folder: Path, launch_arguments: list[str]) -> int:
    """Fly, report and return the exit status: 0 for a good flight."""
    folder.mkdir(parents=True, exist_ok=True)
    log, recordings = folder / "sw_hover.log", folder / "recordings"
    # The frame of the drawn model needs a Debian package that brings 64 others.
    is_seen = "true" if os.environ.get("DISPLAY") and shutil.which("rviz") else "false"
    seen = (f"rviz:={is_seen}", f"publish_base_link:={is_seen}")
    arguments = [
        *LAUNCH_FILE, *ARGUMENTS, f"record_folder:={recordings}", *seen, *launch_arguments
    ]  # fmt: skip
    print(f"launching {' '.join(arguments)}  (its output: {log})", flush=True)
    with roslaunch(arguments, log):
        print(f"watch it with  export ROS_MASTER_URI={os.environ['ROS_MASTER_URI']}", flush=True)
        try:
            wait_for_recording(STATUS)
            fly_and_land()
        except FlightError as error:
            print(f"the flight failed: {error}; see {log}", file=sys.stderr)
            print(*complaints(log), sep="\n", file=sys.stderr)
            return 1
    return report(recordings, folder, log)


def wait_for_recording(topic: str, limit: float = LIMIT) -> None:
    """Wait until the recorder has subscribed to a topic; raises `FlightError` after ``limit``."""
    deadline = time.monotonic() + limit
    graph = rosgraph.Master("/demo")
    try:
        with waiting(f"until {topic} is recorded"):
            while "/recorder" not in dict(graph.getSystemState()[1]).get(topic, []):
                if time.monotonic() > deadline:
                    raise FlightError(f"/recorder has not subscribed to {topic} for {limit:g} s")
                time.sleep(0.05)
    except OSError as error:
        raise FlightError(f"the ROS master answers no more: {error}") from None


def report_recording(recordings: Path, folder: Path) -> tuple[bag_report.Report, list[Flight]]:
    """Write the report of the newest recording into a folder; return it, and the flights in it."""
    recording = max(recordings.glob("*/"), key=lambda path: path.stat().st_mtime)
    page = bag_report.Report()
    with tempfile.TemporaryDirectory(dir=folder) as series:
        (recorded,) = bag_log.read(recording, Path(series))
        with waiting("writing the report"):
            page.add(recorded)
            flown = list(flights(recorded))
            page.write(folder)
    return page, flown


def report(recordings: Path, folder: Path, log: Path) -> int:
    """Print the table of a flight, write page and data; return the exit status."""
    _, (flight,) = report_recording(recordings, folder)
    flight.record.save_csv(folder / "sw_hover.csv")
    hover = FlightReport.of(flight.record, HOVER, HOVER_WINDOW)
    print(hover.table())
    print(f"report: {folder / bag_report.PAGE}\ndata: {folder / 'sw_hover.csv'}")
    if not hover.complaints():
        return 0
    for complaint in hover.complaints():
        print(f"bad flight: {complaint}", file=sys.stderr)
    print(*complaints(log), sep="\n", file=sys.stderr)
    return 1


def main() -> int:
    """Fly by the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="run demo", description=__doc__)
    parser.add_argument(
        "--out", type=Path, default=Path("out"), help="folder for report, data, log"
    )
    parser.add_argument(
        "--journal", action="store_true", help="journals of all processes, for ./run replay"
    )
    parser.add_argument("launch_arguments", nargs="*", help="such as composed:=true")
    options = parser.parse_args()
    if options.journal:
        journals = options.out / "journals"
        options.launch_arguments.append(f"journal:={journals.absolute()}")
        print(f"journals: {journals}", flush=True)
    if "sim_time:=true" not in options.launch_arguments:
        say_if_busy(os.getloadavg()[0], len(os.sched_getaffinity(0)))
    try:
        return fly(options.out.resolve(), options.launch_arguments)
    except LaunchError as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
