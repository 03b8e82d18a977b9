"""Fixtures of the tests with sockets."""

import contextlib
import logging

import pytest
from virtual_client import connected_vehicle

from crazyflie_utils.testing.fixtures import time_limit  # noqa: F401
from crazyflie_virtual.testing import virtual_vehicle


@pytest.fixture(autouse=True)
def no_errors(caplog):
    """Fail a test in which a vehicle meets an error; one that expects some ends with a clear()."""
    yield
    for phase in ("setup", "call"):
        records = caplog.get_records(phase)
        assert [r.getMessage() for r in records if r.levelno >= logging.ERROR] == []


@pytest.fixture
def serve():
    """Return ``serve(**settings)``, which starts a virtual vehicle; it returns server and URI."""
    with contextlib.ExitStack() as stack:
        yield lambda **settings: stack.enter_context(virtual_vehicle(**settings))


@pytest.fixture
def connect():
    """Return ``connect(**settings)``: a vehicle, and a client that is fully connected to it."""
    with contextlib.ExitStack() as stack:
        yield lambda **settings: stack.enter_context(connected_vehicle(**settings))
