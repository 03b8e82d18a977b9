"""Fixtures of the tests: a vehicle in flight."""

import pytest
from takeoff_helpers import SERVER, HoverNetwork


@pytest.fixture
def network():
    """Return a vehicle that hovers."""
    network = HoverNetwork(SERVER)
    network.take_off()
    return network
