"""Virtual motion capture: processes, and vehicles for its cameras to see."""

import socket
import threading
import time

import yaml

from crazyflie_utils.testing.programs import running
from crazyflie_virtual.server import Observation

LIMIT = 60.0

_PERIOD = 0.05
"""From one message of the vehicles to the next, s."""


def virtual_mocap(command_port, observer_port, latency):
    """Run ``rosrun crazyflie_virtual virtual_mocap``."""
    options = {
        "_command_port": command_port,
        "_observer/port": observer_port,
        "_latency": latency,
    }
    arguments = [f"{key}:={value}" for key, value in options.items()]
    return running("rosrun", "crazyflie_virtual", "virtual_mocap", *arguments)


def mocap_launch(folder, config):
    """Run mocap.launch with a configuration."""
    path = folder / "mocap.yaml"
    path.write_text(yaml.safe_dump(config))
    return running("roslaunch", "mocap_optitrack", "mocap.launch", f"mocap_config_file:={path}")


class MovingVehicles:
    """Vehicles that fly straight on, as messages to the virtual cameras.

    Parameters
    ----------
    port : int
        Where the cameras listen.
    vehicles : dict of int to tuple
        Number to name, position (m) at the beginning, velocity (m/s) and
        quaternion.
    """

    def __init__(self, port, vehicles):
        self._port = port
        self._vehicles = vehicles
        self._begin = time.monotonic()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self._over.set()
        self._thread.join(LIMIT)

    def position(self, number, moment):
        """Return the position (m) of a vehicle at a moment of the monotonic clock (s)."""
        _, start, velocity, _ = self._vehicles[number]
        dt = moment - self._begin
        return [a + b * dt for a, b in zip(start, velocity, strict=True)]

    def _run(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            while not self._over.wait(_PERIOD):
                now = time.monotonic()
                for number, (name, _, velocity, quaternion) in self._vehicles.items():
                    observation = Observation(
                        number,
                        name,
                        now,
                        self.position(number, now),
                        velocity,
                        quaternion,
                        (0, 0, 0),
                    )
                    sender.sendto(observation.encode(), ("127.0.0.1", self._port))
