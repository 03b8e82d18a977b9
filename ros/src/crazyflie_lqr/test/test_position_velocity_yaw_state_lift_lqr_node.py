"""The node of the integral state feedback on a fake process."""

import math

import genpy
import numpy as np
import pytest
from lift_controller import PARAMETERS, answer, launch, refer

from crazyflie_lqr.lqr_nodes import (
    PositionVelocityYawStateLiftLqrNode,
)
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess


@pytest.fixture
def process():
    return launch()


def refused(parameters):
    """Return what is logged about parameters that must not do."""
    process = FakeProcess()
    node = PositionVelocityYawStateLiftLqrNode()
    assert not process.launch(node, "/lqr_controller", parameters)
    return process.logged("error")[0]


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_is_required(name):
    parameters = {key: value for key, value in PARAMETERS.items() if key != name}
    assert f"/lqr_controller/{name} is not set" in refused(parameters)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("x_dim", 6),
        ("x_dim", 12),
        ("x_dim", "seven"),
        ("x_dim", math.nan),
        ("u_dim", 3),
        ("K_file", 4),
        ("K_file", ""),
        ("u_ref_file", True),
        ("topics/state", ""),
        ("topics/control", 1.0),
        ("integrator/k/x", "much"),
        ("integrator/k/y", math.nan),
        ("integrator/thresh/z", -0.1),
        ("integrator/thresh/x", math.inf),
    ],
)
def test_bad_parameters_are_named(name, value):
    log = refused({**PARAMETERS, name: value})
    assert f"/lqr_controller/{name} is" in log
    assert "expected" in log


@pytest.mark.parametrize("name", ["K_file", "u_ref_file"])
@pytest.mark.parametrize(
    ("content", "reason"),
    [("zero\n", "line 1"), ("0 0\n", "line 1"), ("0 0 nan 0\n", "line 1"), (None, "No such file")],
)
def test_bad_gain_files_are_named_with_line_and_shape(tmp_path, name, content, reason):
    path = tmp_path / "gains.txt"
    if content is not None:
        path.write_text(content)
    log = refused({**PARAMETERS, name: str(path)})
    shape = {"K_file": "4 rows of 7 numbers", "u_ref_file": "4 numbers"}[name]
    for part in (f"/lqr_controller/{name} is", str(path), reason, f"expected {shape}"):
        assert part in log


def test_is_silent_until_a_reference_has_arrived(process):
    assert answer(process, z=1.0) == []
    refer(process, z=1.0)
    [control] = answer(process, z=1.0)
    np.testing.assert_allclose(control, [0.0, 0.0, 0.0, 9.81])


def test_every_state_is_answered_with_its_stamp(process):
    refer(process)
    for _ in range(5):
        process.advance(0.01)
        assert len(answer(process)) == 1
        message = process.published("/control/lqr")[-1]
        assert message.header.stamp == process.clock.stamp()


def test_reference_yaw_is_zero(process):
    refer(process, x=1.0, y=2.0, z=3.0, x_dot=0.1, y_dot=0.1, z_dot=0.1)
    at_goal = {"x": 1.0, "y": 2.0, "z": 3.0, "x_dot": 0.1, "y_dot": 0.1, "z_dot": 0.1}
    [control] = answer(process, yaw=0.2, **at_goal)
    np.testing.assert_allclose(control, [0.0, 0.0, -0.7, 9.81], atol=1e-12)


def test_signs_and_sizes_of_the_soft_gains(process):
    refer(process)
    [control] = answer(process, x=0.2, y=0.4, z=0.1, x_dot=0.1, y_dot=-0.05, z_dot=0.2, yaw=0.0)
    np.testing.assert_allclose(control, [0.05, -0.15, 0.0, 9.81 - 0.35])


def test_parameters_of_the_integrator_arrive():
    extra = {"integrator/k/x": -0.1, "integrator/thresh/x": 0.03, "integrator/k/z": -1}
    process = launch(**extra)
    refer(process)
    for _ in range(10):
        [control] = answer(process, x=0.1, z=0.1)
        process.advance(0.1)
    np.testing.assert_allclose(control, [0.0, -0.025 - 0.003, 0.0, 9.81 - 0.15])


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_states_that_are_not_finite_are_ignored(process, bad):
    refer(process)
    for field in PositionVelocityYawState.__slots__:
        assert answer(process, **{field: bad}) == []
    [warning] = process.logged("warn")
    assert "/lqr_controller" in warning and "/state" in warning
    assert len(answer(process)) == 1


def test_a_broken_source_of_references_is_not_followed_for_ever(process):
    refer(process, x=0.5)
    [toward_goal] = answer(process, x=0.2)
    for _ in range(4):
        refer(process, x=math.nan)
        process.advance(0.1)
    [control] = answer(process, x=0.2)
    np.testing.assert_array_equal(control, toward_goal)
    process.advance(0.2)
    [stopping] = answer(process, x=0.3, x_dot=0.1)
    np.testing.assert_allclose(stopping, [0.0, -0.1, 0.0, 9.81])
    [returning] = answer(process, x=0.4)
    np.testing.assert_allclose(returning, [0.0, -0.025, 0.0, 9.81])
    assert len(process.logged("warn")) == 1
    refer(process, x=0.5)
    [control] = answer(process, x=0.2)
    np.testing.assert_array_equal(control, toward_goal)


def test_a_bad_first_reference_does_not_start_it(process):
    refer(process, z_dot=math.inf)
    process.advance(1.0)
    assert answer(process) == []


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_control_that_overflows_is_not_sent(process):
    refer(process)
    assert answer(process, x_dot=1.7e308, y_dot=1.7e308, yaw=0.8) == []
    assert "not finite" in process.logged("warn")[0]


# Who may say where to fly.


def stamped_reference(x, stamp):
    message = PositionVelocityStateStamped(state=PositionVelocityState(x=x))
    message.header.stamp = genpy.Time.from_sec(stamp)
    return message


def test_of_two_latched_references_the_younger_one_counts_in_either_order(process):
    for first, second in ((90.0, 80.0), (91.0, 95.0)):
        process.publish("/ref", stamped_reference(first / 100.0, first))
        process.publish("/ref", stamped_reference(second / 100.0, second))
        goal = max(first, second) / 100.0
        assert answer(process, x=goal)[0][1] == pytest.approx(0.0)
    (warning,) = process.logged("warn")
    assert "/ref" in warning and "older" in warning


def test_a_descent_cannot_be_disturbed(process):
    refer(process, x=0.5)
    for _ in range(10):
        process.publish("/ref_descent", stamped_reference(0.1, 0.0))
        process.advance(0.1)
        refer(process, x=0.5)
        assert answer(process, x=0.1)[0][1] == pytest.approx(0.0)
    process.advance(0.3)
    assert answer(process, x=0.1)[0][1] == pytest.approx(0.1)


def test_bad_references_of_a_descent_are_ignored(process):
    refer(process, x=0.5)
    process.publish("/ref_descent", stamped_reference(math.nan, 0.0))
    assert answer(process, x=0.5)[0][1] == pytest.approx(0.0)


def test_the_topic_of_the_descent_can_be_chosen():
    process = launch(**{"topics/descent_reference": "/down"})
    assert "/down" in process.transport.subscribers
    assert "/ref_descent" not in process.transport.subscribers


@pytest.mark.parametrize(("size", "warnings"), [(2.9, 0), (50.0, 1), (1.7e308, 1)])
def test_a_reference_far_away_is_no_step(process, size, warnings):
    refer(process, z=size)
    thrusts = []
    for _ in range(100):
        process.advance(0.01)
        thrusts.append(answer(process)[0][3])
    if warnings:
        assert thrusts[0] == pytest.approx(9.81)
        assert 0.5 < thrusts[-1] - 9.81 < 1.0
        assert max(np.diff(thrusts)) < 0.02
    else:
        assert thrusts == pytest.approx([9.81 + 1.5 * 2.9] * 100)
    assert len(process.logged("warn")) == warnings
    refer(process, z=1.0)
    assert answer(process)[0][3] == pytest.approx(9.81 + 1.5)


def test_states_that_are_old_are_not_answered(process):
    refer(process, z=1.0)
    message = PositionVelocityYawStateStamped()
    for age, is_answered in ((0.4, True), (0.6, False), (30.0, False), (90.0, False)):
        before = len(process.published("/control/lqr"))
        message.header.stamp = process.clock.stamp(process.clock.time() - age)
        process.publish("/state", message)
        assert len(process.published("/control/lqr")) - before == is_answered
    assert "/lqr_controller: ignoring a state that is 0.6 s old" in process.logged("warn")[0]


def test_a_velocity_that_is_too_large_is_followed_at_the_limit_and_for_half_a_second(process):
    refer(process, x_dot=0.1, y_dot=-0.2)
    np.testing.assert_allclose(answer(process)[0], [0.2, 0.1, 0.0, 9.81])
    refer(process, z=0.5, z_dot=5.0)
    assert answer(process, z=0.5)[0][3] == pytest.approx(9.81 + 2.0)
    assert "has a velocity of 5.0 m/s; expected <= 2 m/s" in process.logged("warn")[0]
    process.advance(0.49)
    assert answer(process, z=0.5)[0][3] == pytest.approx(9.81 + 2.0)
    process.advance(0.02)
    assert answer(process, z=0.5)[0][3] == pytest.approx(9.81)


def test_the_limit_of_velocities_may_be_changed_but_not_beyond_what_the_estimator_believes(process):
    process.reconfigure("/lqr_controller", **{"reference/max_speed": 1.0})
    refer(process, z_dot=5.0)
    assert answer(process)[0][3] == pytest.approx(9.81 + 1.0)
    with pytest.raises(ServiceError, match="reference/max_speed"):
        process.reconfigure("/lqr_controller", **{"reference/max_speed": 5.1})


@pytest.mark.parametrize("stamp", [0.0, 12.000000345])
def test_states_without_stamps_of_this_clock_are_answered(process, stamp):
    refer(process, z=1.0)
    process.advance(100.0)
    message = PositionVelocityYawStateStamped()
    message.header.stamp = process.clock.stamp(stamp)
    for count in range(1, 5):
        process.publish("/state", message)
        assert len(process.published("/control/lqr")) == count
        assert process.published("/control/lqr")[-1].header.stamp == message.header.stamp
        process.advance(1.0)
