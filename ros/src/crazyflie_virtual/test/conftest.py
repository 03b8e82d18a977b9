"""Fixtures of the tests with sockets."""

import faulthandler

import pytest

from crazyflie_virtual.server import Server
from crazyflie_virtual.settings import Settings


@pytest.fixture(autouse=True)
def limit():
    """End the tests when one hangs: cflib can wait for ever."""
    faulthandler.dump_traceback_later(120.0, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()


@pytest.fixture
def serve():
    """Return ``serve(**options)``, which starts a virtual vehicle and returns it with its URI."""
    servers = []

    def serve(**options):
        server = Server(Settings(**{"port": 0, "observer_port": 0, **options}))
        servers.append(server)
        server.start()
        return server, "udp://{}:{}".format(*server.address)

    yield serve
    for server in servers:
        server.stop()
