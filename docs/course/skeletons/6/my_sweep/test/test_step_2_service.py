"""Step 2: the service, in a process without a master."""

import pytest

from crazyflie_tutorial_msgs.srv import VelocityAtRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess
from my_sweep.oscillator_node import OscillatorNode


@pytest.fixture
def process():
    """Return a process with the node in it."""
    fake = FakeProcess()
    assert fake.launch(OscillatorNode(), "/oscillator")
    return fake


def test_answers(process):
    assert process.call("/my_oscillator", VelocityAtRequest(5.5)).vel == pytest.approx(2.1)


def test_refuses_what_is_outside(process):
    with pytest.raises(ServiceError, match="expected 2 to 9"):
        process.call("/my_oscillator", VelocityAtRequest(1.0))
