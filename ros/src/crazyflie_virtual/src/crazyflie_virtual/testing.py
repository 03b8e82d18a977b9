"""Virtual vehicles for tests, in the process of the test."""

import contextlib
from collections.abc import Iterator

from crazyflie_virtual.server import Server
from crazyflie_virtual.settings import Settings


@contextlib.contextmanager
def virtual_vehicle(**settings: object) -> Iterator[tuple[Server, str]]:
    """Run a vehicle, on a free port unless told otherwise; yield its server and its address.

    Parameters
    ----------
    settings
        Of `crazyflie_virtual.settings.Settings`.
    """
    server = Server(Settings(**{"port": 0, "observer_port": 0, **settings}))
    server.start()
    try:
        yield server, "udp://{}:{}".format(*server.address)
    finally:
        server.stop()
