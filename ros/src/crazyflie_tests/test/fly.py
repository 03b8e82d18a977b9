"""Fly a launch file on a master of its own, and judge the flight.

Usage: fly.py PACKAGE FILE [ARGUMENT:=VALUE ...]
"""

import sys
import tempfile
from pathlib import Path

from crazyflie_reports.flight_operator import FlightError, FlightOperator
from crazyflie_reports.flight_record import FlightReport
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import roslaunch

HOVER = (0.0, 0.0, 1.0)
HOVER_DURATION = 6.0


def main(arguments: list[str]) -> int:
    """Take off, hover, land; return the exit status, 0 for a good flight."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "launch.log"
        with roslaunch(arguments, log):
            try:
                record = FlightOperator(begin("flight")).fly(HOVER_DURATION)
            except FlightError as error:
                print(f"the flight failed: {error}\n{log.read_text()}")
                return 1
    report = FlightReport.of(record, HOVER)
    print(report.table())
    state = dict(zip(record.state.fields, record.state.last, strict=True))
    print(f"yaw at the end: {state['yaw']:.3f}")
    for complaint in report.complaints():
        print(f"bad flight: {complaint}")
    return 1 if report.complaints() else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
