"""Virtual vehicles for tests, in the process of the test."""

import contextlib
from collections.abc import Iterator
from typing import Any

from crazyflie_virtual.server import VehicleServer
from crazyflie_virtual.settings import VehicleSettings


@contextlib.contextmanager
def virtual_vehicle(**settings: Any) -> Iterator[tuple[VehicleServer, str]]:
    """Run a vehicle with `VehicleSettings`, by default on a free port; yield server and address."""
    server = VehicleServer(VehicleSettings(**{"port": 0, "observer_port": 0, **settings}))
    server.start()
    try:
        yield server, "udp://{}:{}".format(*server.address)
    finally:
        server.stop()
