"""Virtual vehicles and launch files for the flights that are tests."""

import contextlib
import os
import socket
import time

import rospy

from crazyflie_demo.joystick import AXIS, BUTTON, EVENT
from crazyflie_utils.testing.programs import free_port, running
from crazyflie_virtual.server import Observation

LIMIT = 60.0
"""How long anything may take to come about, s."""

_SCAN = b"\xff"
"""cflib's request to a port, which a vehicle answers."""


class Observer:
    """Hears the truth about a virtual vehicle.

    Attributes
    ----------
    port : int
        Where the vehicle has to tell it.
    """

    def __init__(self):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(LIMIT)
        self.port = self._socket.getsockname()[1]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._socket.close()

    def track_until(self, is_it, limit=LIMIT):
        """Return all truths until the first one, included, for which ``is_it(truth)``."""
        end = time.monotonic() + limit
        track = []
        while True:
            seen = Observation.decode(self._socket.recv(1024))
            if seen is not None:
                track.append(seen)
                if is_it(track[-1]):
                    return track
            assert time.monotonic() < end, f"in the end: {track[-1:]}"


def launched(package, file, **arguments):
    """Run a launch file; roslaunch ends its nodes when it is interrupted, not when it is killed."""
    given = [f"{name}:={value}" for name, value in arguments.items()]
    return running("roslaunch", "--screen", package, file, *given)


def node(package, name, *remappings, **parameters):
    """Run a node."""
    given = [f"_{key}:={value}" for key, value in parameters.items()]
    return running("rosrun", package, name, *remappings, *given)


@contextlib.contextmanager
def virtual_vehicle(number=1, **parameters):
    """Run a virtual vehicle, which motion capture sees as a body; yield its address."""
    port = free_port()
    name = f"__name:=virtual_crazyflie_{number}"
    parameters = {"observer/id": number, "observer/name": f"cf{number}", **parameters}
    with (
        node("crazyflie_virtual", "virtual_crazyflie", name, port=port, **parameters),
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client,
    ):
        client.settimeout(0.1)
        end = time.monotonic() + LIMIT
        while True:
            assert time.monotonic() < end, "the virtual vehicle does not answer"
            client.sendto(_SCAN, ("127.0.0.1", port))
            with contextlib.suppress(TimeoutError, ConnectionRefusedError):
                client.recv(64)
                break
        yield f"udp://127.0.0.1:{port}"


class Stick:
    """A joystick of which the test holds the stick: a FIFO in the place of the device."""

    def __init__(self, path):
        os.mkfifo(path)
        # Also for reading: opening it does not wait for the node then.
        self._file = os.open(path, os.O_RDWR)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self._file)

    def tilt(self, axis, part):
        """Tilt an axis by a part of its way, left and up positive."""
        os.write(self._file, EVENT.pack(0, round(-32767 * part), AXIS, axis))

    def press(self, button):
        """Press a button and let it go."""
        for value in (1, 0):
            os.write(self._file, EVENT.pack(0, value, BUTTON, button))


def wait_for_service(name):
    """Wait until a service is there."""
    rospy.wait_for_service(name, LIMIT)


@contextlib.contextmanager
def observed_vehicle():
    """Run a vehicle that the driver knows as /crazyflie; yield an observer of it."""
    with (
        Observer() as observer,
        virtual_vehicle(**{"observer/port": observer.port}) as uri,
        launched("crazyflie_demo", "customLogBlocks.launch", uri=uri),
    ):
        wait_for_service("/crazyflie/takeoff")
        yield observer
