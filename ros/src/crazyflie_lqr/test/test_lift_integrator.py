"""When the lift controller integrates, and what changes of its parameters do in flight."""

import numpy as np
import pytest
from lift_controller import (
    LIFT,
    PARAMETERS,
    answer,
    launch,
    lifting,
    publish_flight_state,
    refer,
)
from std_msgs.msg import Float64

from crazyflie_lqr.lqr_nodes import PositionVelocityYawStateLiftLqrNode
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess


@pytest.fixture
def process():
    return launch()


def thrusts(process, duration, **state):
    """Return the thrusts that answer a state for some seconds."""
    return [
        answer(process, **state)[0][3]
        for _ in range(round(duration / 0.1))
        if process.advance(0.1) is None
    ]


def test_on_the_ground_nothing_is_integrated_and_a_takeoff_begins_from_zero():
    process = lifting()
    publish_flight_state(process, "on_ground")
    refer(process, z=1.0)
    assert thrusts(process, 30.0) == pytest.approx([9.81 + 1.5] * 300)
    publish_flight_state(process, "taking_off")
    assert thrusts(process, 1.0) == pytest.approx([9.81 + 1.5] * 10)
    refer(process, z=1.0)
    course = thrusts(process, 1.5)
    assert course[0] == pytest.approx(9.81)
    # It grows until the vehicle lifts off, without a step.
    assert course[-1] > course[0] + 1.5
    assert max(np.abs(np.diff(course))) < 0.6
    publish_flight_state(process, "on_ground")
    assert thrusts(process, 1.0) == pytest.approx([9.81 + 1.5] * 10)


def test_in_flight_it_integrates():
    process = lifting()
    publish_flight_state(process, "flying")
    refer(process, z=1.0)
    thrusts(process, 3.0, z=1.0)
    course = thrusts(process, 1.0, z=0.9)
    assert course[-1] - course[0] == pytest.approx(0.9 * 0.1 * 0.5)
    publish_flight_state(process, "landing")
    assert thrusts(process, 1.0, z=0.9) == pytest.approx([9.81 + 0.15] * 10)


def test_without_a_flight_state_it_integrates_in_the_air_and_while_it_may_lift_off():
    process = lifting()
    refer(process, z=1.0)
    standing = thrusts(process, 30.0)
    assert standing[20] > standing[0] + 0.9
    assert standing[-1] == pytest.approx(9.81 + 1.5)
    flying = thrusts(process, 1.0, z=0.5)
    assert flying[-1] - flying[0] == pytest.approx(0.9 * 0.5 * 0.5)


def test_the_topic_of_the_flight_status_can_be_chosen():
    process = lifting(**{"topics/flight_status": "/cf1/state_of_flight"})
    process.publish("/cf1/state_of_flight", FlightStatus(state=FlightStatus.ON_GROUND))
    refer(process, z=1.0)
    assert thrusts(process, 2.0) == pytest.approx([9.81 + 1.5] * 20)


@pytest.mark.parametrize("nodes", [("lqr_controller",), ("takeoff_server", "filter")])
def test_the_flight_is_that_of_the_topic_in_flight_also_if_only_its_neighbours_have_it(nodes):
    process = FakeProcess()
    for node in nodes:
        process.transport.parameters[f"/HY4/{node}/topics/in_flight"] = "/in_flightHY4"
    process.transport.parameters["/HY5/takeoff_server/topics/in_flight"] = "/in_flightHY5"
    node = PositionVelocityYawStateLiftLqrNode()
    assert process.launch(node, "/HY4/lqr_controller", {**PARAMETERS, **LIFT})
    status = FlightStatus(state=FlightStatus.ON_GROUND)
    process.publish("/in_flightHY4_flight_status", status)
    process.publish("/in_flightHY4_hover_thrust", Float64(9.0))
    refer(process, z=1.0)
    assert thrusts(process, 2.0) == pytest.approx([9.0 + 1.5] * 20)


# Changes in flight.


def test_gains_may_be_changed_in_flight(process, tmp_path):
    gains = tmp_path / "K.txt"
    gains.write_text("0 0 0 0 0 0 0\n" * 3 + "0 0 -2 0 0 0 0\n")
    refer(process, z=1.0)
    process.reconfigure("/lqr_controller", K_file=str(gains))
    [control] = answer(process, z=0.5)
    np.testing.assert_allclose(control, [0.0, 0.0, 0.0, 9.81 + 1.0])


def test_a_change_of_the_integrator_keeps_its_integral(process):
    process.reconfigure("/lqr_controller", **{"integrator/k/z": -1.0, "integrator/thresh/z": 1.0})
    refer(process, z=1.0)
    for _ in range(6):
        [before] = answer(process, z=0.8)
        process.advance(0.1)
    process.reconfigure("/lqr_controller", **{"integrator/k/x": -0.1})
    [after] = answer(process, z=0.8)
    assert before[3] == pytest.approx(9.81 + 0.3 + 0.1)
    assert after[3] == pytest.approx(9.81 + 0.3 + 0.12)


def test_bad_gains_are_refused_and_the_old_ones_stay(process, tmp_path):
    gains = tmp_path / "K.txt"
    gains.write_text("0 0 0\n")
    refer(process, z=1.0)
    [before] = answer(process, z=0.5)
    with pytest.raises(ServiceError, match=r"line 1: 3 numbers, expected 4 rows of 7 numbers"):
        process.reconfigure("/lqr_controller", K_file=str(gains))
    [after] = answer(process, z=0.5)
    np.testing.assert_array_equal(after, before)


def test_a_takeoff_begins_with_the_thrust_of_hover_that_was_measured_and_it_is_forgotten():
    process = lifting()
    publish_flight_state(process, "taking_off")
    process.publish("/in_flight_hover_thrust", Float64(8.0))
    refer(process, z=1.0)
    assert thrusts(process, 0.1) == pytest.approx([8.0])
    publish_flight_state(process, "flying")
    # No thrust of hover is like that.
    process.publish("/in_flight_hover_thrust", Float64(99.0))
    assert thrusts(process, 0.1, z=1.0)[0] < 9.0
    publish_flight_state(process, "on_ground")
    assert thrusts(process, 0.1) == pytest.approx([9.81 + 1.5])


def test_gains_that_are_changed_in_flight_keep_the_thrust_of_hover():
    process = lifting()
    publish_flight_state(process, "flying")
    process.publish("/in_flight_hover_thrust", Float64(8.0))
    refer(process, z=1.0)
    before = thrusts(process, 3.0, z=1.0)[-1]
    process.reconfigure("/lqr_controller", **{"integrator/k/x": -0.01})
    assert thrusts(process, 0.1, z=1.0) == pytest.approx([before], abs=0.1)
    assert before == pytest.approx(8.0, abs=0.5)
