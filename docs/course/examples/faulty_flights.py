"""Flies three flights, each with a hidden fault, and records them in ~/flights/a, b and c.

python3 faulty_flights.py [--out FOLDER]
"""

import argparse
import base64
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from crazyflie_reports.flight_operator import FlightOperator
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import roslaunch

FLIGHT = (
    "crazyflie_examples sw_hover.launch dynamics:=quadrotor integrator_k_x:=0 integrator_k_y:=0 "
    "integrator_k_z:=0 rviz:=false sim_time:=true real_time_factor:=5 composed:=true "
    "simulator_dt:=0.01 record:=true"
).split()

HIDDEN = {
    "a": "e3dpbmQveTogMS41fQ==",
    "b": "e21vY2FwL2Ryb3BvdXQ6IDAuODV9",
    "c": "e21hc3NfZXJyb3I6IC0wLjA4fQ==",
}
"""Live parameters of the simulator, encoded: whoever decodes them spoils the exercise."""


def fly(parameters: str) -> None:
    """Take off, hover, step half a metre ahead and to the left, land; with these parameters."""
    operator = FlightOperator(begin("faulty_flights"))
    operator.wait_until_ready()
    subprocess.run(
        ["rosrun", "dynamic_reconfigure", "dynparam", "set", "/simulator", parameters],
        check=True,
        timeout=60.0,
        stdout=subprocess.DEVNULL,
    )
    operator.takeoff()
    operator.hover(8.0)
    operator.refer_to((0.5, 0.5, 1.0))
    operator.hover(6.0)
    operator.land()


def main() -> int:
    """Fly all, each in a process of its own; return the status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path.home() / "flights")
    out = parser.parse_args().out.resolve()
    status = 0
    for name, hidden in HIDDEN.items():
        folder = out / name
        if os.fork() == 0:
            with tempfile.TemporaryDirectory() as logs:
                log = Path(logs) / "roslaunch.log"
                with roslaunch([*FLIGHT, f"record_folder:={folder}"], log):
                    fly(base64.b64decode(hidden).decode())
            print(folder, flush=True)
            os._exit(0)
        status |= os.wait()[1]
    return int(status != 0)


if __name__ == "__main__":
    sys.exit(main())
