"""Take off, fly half a metre forward, land: a plain cflib program for a real or a virtual vehicle.

    python3 hover.py [URI]

It knows nothing of ROS or of this workspace.
"""

import sys
import time

import cflib.crtp
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

URI = "udp://127.0.0.1:19850"

HEIGHT = 0.5
"""m."""


def log_position(crazyflie: Crazyflie) -> None:
    """Print the vehicle's own estimate of its position, twice a second."""
    config = LogConfig("position", period_in_ms=500)
    for variable in ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z"):
        config.add_variable(variable)
    config.data_received_cb.add_callback(
        lambda time_ms, values, _: print(*(f"{value:6.2f}" for value in values.values()))
    )
    crazyflie.log.add_config(config)
    config.start()


def fly(crazyflie: Crazyflie) -> None:
    """Take off, move and land by commands to the controller on board."""
    commander = crazyflie.high_level_commander
    commander.takeoff(HEIGHT, 2.0)
    time.sleep(3.0)
    commander.go_to(0.5, 0.0, HEIGHT, 0.0, 2.0)
    time.sleep(3.0)
    commander.land(0.0, 2.0)
    time.sleep(3.0)
    commander.stop()


if __name__ == "__main__":
    cflib.crtp.init_drivers()
    with SyncCrazyflie(sys.argv[1] if len(sys.argv) > 1 else URI, cf=Crazyflie()) as connection:
        log_position(connection.cf)
        fly(connection.cf)
