"""The node of the integral state feedback on a fake process."""

import math
from pathlib import Path

import numpy as np
import pytest
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import ReconfigureRequest

from crazyflie_lqr.position_velocity_yaw_state_lift_lqr_node import (
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
from crazyflie_utils.vectors import to_vector

CONFIG = Path(__file__).parents[1] / "config"
PARAMETERS = {
    "x_dim": 7,
    "u_dim": 4,
    "K_file": str(CONFIG / "K_soft.txt"),
    "u_ref_file": str(CONFIG / "u_ref_hover.txt"),
    "topics/reference": "/ref",
    "topics/state": "/state",
    "topics/control": "/control/lqr",
}


@pytest.fixture
def process():
    """Return a process with a controller in it."""
    process = FakeProcess()
    assert process.launch(PositionVelocityYawStateLiftLqrNode(), "/lqr_controller", PARAMETERS)
    return process


def refused(parameters):
    """Return what is logged about parameters that must not do."""
    process = FakeProcess()
    node = PositionVelocityYawStateLiftLqrNode()
    assert not process.launch(node, "/lqr_controller", parameters)
    return process.logged("error")[0]


def refer(process, x=0.0, **values):
    process.publish(
        "/ref", PositionVelocityStateStamped(state=PositionVelocityState(x=x, **values))
    )


def answer(process, **values):
    """Send a state stamped now; return the new controls, as vectors."""
    before = len(process.published("/control/lqr"))
    message = PositionVelocityYawStateStamped(state=PositionVelocityYawState(**values))
    message.header.stamp = process.clock.stamp()
    process.publish("/state", message)
    return [to_vector(m.control) for m in process.published("/control/lqr")[before:]]


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
    process = FakeProcess()
    extra = {"integrator/k/x": -0.1, "integrator/thresh/x": 0.03, "integrator/k/z": -1}
    node = PositionVelocityYawStateLiftLqrNode()
    assert process.launch(node, "/lqr_controller", {**PARAMETERS, **extra})
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
    refer(process, x=-1.7e308)
    assert answer(process, x=1.7e308) == []
    assert "not finite" in process.logged("warn")[0]


# Changes in flight.


def reconfigure(process, **values):
    """Change parameters as dynamic_reconfigure does."""
    request = ReconfigureRequest(encode_config(values))
    return process.call("/lqr_controller/set_parameters", request)


def test_gains_may_be_changed_in_flight(process, tmp_path):
    gains = tmp_path / "K.txt"
    gains.write_text("0 0 0 0 0 0 0\n" * 3 + "0 0 -2 0 0 0 0\n")
    refer(process, z=1.0)
    reconfigure(process, K_file=str(gains))
    [control] = answer(process, z=0.5)
    np.testing.assert_allclose(control, [0.0, 0.0, 0.0, 9.81 + 1.0])


def test_a_change_of_the_integrator_keeps_its_integral(process):
    reconfigure(process, **{"integrator/k/z": -1.0, "integrator/thresh/z": 1.0})
    refer(process, z=1.0)
    for _ in range(6):
        [before] = answer(process, z=0.8)
        process.advance(0.1)
    reconfigure(process, **{"integrator/k/x": -0.1})
    [after] = answer(process, z=0.8)
    assert before[3] == pytest.approx(9.81 + 0.3 + 0.1)
    assert after[3] == pytest.approx(9.81 + 0.3 + 0.12)


def test_bad_gains_are_refused_and_the_old_ones_stay(process, tmp_path):
    gains = tmp_path / "K.txt"
    gains.write_text("0 0 0\n")
    refer(process, z=1.0)
    [before] = answer(process, z=0.5)
    with pytest.raises(ServiceError, match=r"line 1: 3 numbers, expected 4 rows of 7 numbers"):
        reconfigure(process, K_file=str(gains))
    [after] = answer(process, z=0.5)
    np.testing.assert_array_equal(after, before)
