"""Fixtures of the tests with sockets."""

import contextlib

import pytest

from crazyflie_dev.fixtures import time_limit  # noqa: F401
from crazyflie_virtual.testing import virtual_vehicle


@pytest.fixture
def serve():
    """Return ``serve(**settings)``, which starts a virtual vehicle; it returns server and URI."""
    with contextlib.ExitStack() as stack:
        yield lambda **settings: stack.enter_context(virtual_vehicle(**settings))
