"""The velocity, and the service that tells it."""

import pytest

from crazyflie_tutorial_msgs.srv import VelocityAtRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess
from triangle_velocity.triangle_velocity_node import TriangleVelocityNode


@pytest.fixture
def velocity():
    """Return a function that asks the service."""
    process = FakeProcess()
    assert process.launch(TriangleVelocityNode(), "/triangle_velocity")
    return lambda x: process.call("/triangle", VelocityAtRequest(x)).vel


@pytest.mark.parametrize(("x", "expected"), [(2.0, 0.2), (3.75, 1.1), (5.5, 2.0), (9.0, 0.2)])
def test_grows_to_the_middle(velocity, x, expected):
    assert velocity(x) == pytest.approx(expected)


@pytest.mark.parametrize("x", [1.9, 9.1, float("nan")])
def test_outside_there_is_none(velocity, x):
    with pytest.raises(ServiceError, match="expected 2 to 9"):
        velocity(x)
