"""A controller is any object with `control(x, x_ref, time)`."""

import math

import numpy as np
import pytest
from lift_controller import PARAMETERS, answer, publish_flight_state, refer

from crazyflie_lqr.linear_feedback import LinearFeedback
from crazyflie_lqr.linear_feedback_node import LinearFeedbackNode
from crazyflie_msgs.msg import PositionVelocityStateStamped, PositionVelocityYawStateStamped
from crazyflie_utils.testing import FakeProcess

GAIN = 2.0


class ByArrays:
    """A law of its own, derived from nothing."""

    def control(self, x, x_ref, time):
        error = (x_ref - x)[:3]
        return np.array([0.0, 0.0, 0.0, 9.81 + GAIN * error[2]])


class ByFloats:
    def control(self, x, x_ref, time):
        return 0.0, 0.0, 0.0, 9.81 + GAIN * math.fsum((x_ref[2], -x[2]))


class Derived(LinearFeedback):
    def __init__(self):
        super().__init__(np.zeros((4, 7)), (0.0, 0.0, 0.0, 9.81), 6)

    def control(self, x, x_ref, time):
        u = super().control(x, x_ref, time)
        u[[3]] += GAIN * (x_ref - x)[[2]]
        return u


@pytest.fixture(params=[ByArrays, ByFloats, Derived])
def process(request):
    class OwnNode(LinearFeedbackNode):
        state_type = PositionVelocityYawStateStamped
        reference_type = PositionVelocityStateStamped
        reference_tail = (0.0,)
        yaw_index = 6

        def make_controller(self, parameters):
            return request.param()

    process = FakeProcess()
    assert process.launch(OwnNode(), "/lqr_controller", PARAMETERS)
    return process


def test_its_references_are_governed(process):
    publish_flight_state(process, "taking_off")
    refer(process, z=1.0)
    assert answer(process, z=0.5)[0] == pytest.approx([0.0, 0.0, 0.0, 10.81])
    publish_flight_state(process, "flying")
    # Not the jump, the velocity nor the place that are too far, and a descent before all others.
    refer(process, z=50.0)
    assert answer(process, z=1.0)[0][3] == pytest.approx(9.81)
    process.publish("/ref_descent", PositionVelocityStateStamped())
    assert answer(process, z=1.0)[0][3] == pytest.approx(7.81)
    assert len(process.logged("warn")) == 1


def test_its_parameters_may_change_in_flight(process):
    publish_flight_state(process, "flying")
    refer(process, z=4.5)
    process.reconfigure("/lqr_controller", **{"reference/max_jump": 5.0})
    refer(process, z=4.5)
    assert answer(process, z=0.5)[0][3] == pytest.approx(9.81 + 8.0)


def test_a_control_of_the_wrong_length_is_named():
    class ShortNode(LinearFeedbackNode):
        state_type = PositionVelocityYawStateStamped
        reference_type = PositionVelocityStateStamped
        reference_tail = (0.0,)
        yaw_index = 6

        def make_controller(self, parameters):
            return type("Short", (), {"control": lambda self, x, x_ref, time: [9.81]})()

    process = FakeProcess()
    assert process.launch(ShortNode(), "/lqr_controller", PARAMETERS)
    refer(process, z=1.0)
    assert answer(process, z=0.5) == []
    assert "Control has 4 fields" in process.logged("error")[0]
