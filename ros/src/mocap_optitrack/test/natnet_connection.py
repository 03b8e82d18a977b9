"""A virtual NatNet server on this machine, and a connection to it."""

import contextlib
import socket
import time

import pytest

from crazyflie_virtual.mocap import MocapServer, MocapSettings
from crazyflie_virtual.server import Observation
from mocap_optitrack.mocap_parameters import NatNetParameters
from mocap_optitrack.natnet_source import NatNetSource

LIMIT = 60.0
GROUP = "239.255.42.99"


@contextlib.contextmanager
def server(command_port=0, **options):
    """Run a virtual server that sees bodies 1 and 7."""
    settings = MocapSettings(command_port=command_port, observer_port=0, rate=200.0, **options)
    running = MocapServer(settings)
    running.start()
    try:
        see(running)
        yield running
    finally:
        running.stop()


def see(running, name="cf1"):
    """Make a server see its bodies."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for number, body in [(1, name), (7, "cf7")]:
            seen = Observation(
                number, body, time.monotonic(), (number, 2, 3), (0, 0, 0), (0, 0, 0, 1), (0, 0, 0)
            )
            sender.sendto(seen.encode(), ("127.0.0.1", running.observer_port))


@contextlib.contextmanager
def connection(port, warn=pytest.fail, **settings):
    """Return an open connection and its description."""
    settings = {"server_address": "127.0.0.1", **settings}
    source = NatNetSource(NatNetParameters(command_port=port, **settings), time.monotonic, warn)
    try:
        yield source, source.open()
    finally:
        source.close()


def wait_for_frame(source, accept=lambda frame: frame.bodies):
    """Return the first frame that is accepted."""
    end = time.monotonic() + LIMIT
    while time.monotonic() < end:
        frame = source.read(0.1)
        if frame is not None and accept(frame):
            return frame
    raise TimeoutError


def is_named(frame):
    """Tell whether all bodies have their names."""
    return frame.bodies and all(body.name for body in frame.bodies)
