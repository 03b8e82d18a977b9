"""The nodes whose reference is of the type of their state, on a fake process."""

import math
from pathlib import Path

import numpy as np
import pytest

from crazyflie_lqr.gain_file import save_matrix
from crazyflie_lqr.lqr_nodes import FullStateLqrNode, PositionVelocityYawStateLqrNode
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import from_vector, to_vector

CONFIG = Path(__file__).parents[1] / "config"
NODES = [(PositionVelocityYawStateLqrNode, 7, 6), (FullStateLqrNode, 12, 8)]


@pytest.fixture(params=NODES, ids=lambda node: node[0].__name__)
def variant(request):
    """Return a node class, its x_dim and the index of its yaw."""
    return request.param


@pytest.fixture
def gains(variant):
    """Return gains, shape (4, x_dim)."""
    return np.random.default_rng(5).normal(size=(4, variant[1]))


@pytest.fixture
def parameters(variant, gains, tmp_path):
    """Return the node's parameters."""
    save_matrix(str(tmp_path / "K.txt"), gains)
    return {
        "x_dim": variant[1],
        "u_dim": 4,
        "K_file": str(tmp_path / "K.txt"),
        "u_ref_file": str(CONFIG / "u_ref_hover.txt"),
        "topics/reference": "/ref",
        "topics/state": "/state",
        "topics/control": "/control/lqr",
    }


@pytest.fixture
def process(variant, parameters):
    """Return a process with the node in it."""
    process = FakeProcess()
    assert process.launch(variant[0](), "/lqr_controller", parameters)
    return process


def send(process, variant, topic, vector):
    """Publish a state or reference, stamped now."""
    message_type = variant[0].state_type
    state_type = type(message_type().state)
    message = message_type(state=from_vector(state_type, vector))
    message.header.stamp = process.clock.stamp()
    process.publish(topic, message)


@pytest.mark.parametrize("name", ["x_dim", "u_dim", "K_file", "u_ref_file", "topics/state"])
def test_parameters_are_required(variant, parameters, name):
    process = FakeProcess()
    del parameters[name]
    assert not process.launch(variant[0](), "/lqr_controller", parameters)
    assert f"/lqr_controller/{name} is not set" in process.logged("error")[0]


@pytest.mark.parametrize(("name", "value"), [("x_dim", 6), ("x_dim", 9.5), ("u_dim", 3)])
def test_dimensions_must_fit_the_node(variant, parameters, name, value):
    process = FakeProcess()
    assert not process.launch(variant[0](), "/lqr_controller", {**parameters, name: value})
    log = process.logged("error")[0]
    assert f"/lqr_controller/{name} is {value}; expected the integer" in log


def test_gains_must_have_the_nodes_shape(variant, parameters, gains):
    save_matrix(parameters["K_file"], gains[:, 1:])
    process = FakeProcess()
    assert not process.launch(variant[0](), "/lqr_controller", parameters)
    log = process.logged("error")[0]
    for part in ("/lqr_controller/K_file", "line 1", f"expected 4 rows of {variant[1]} numbers"):
        assert part in log


def test_control_is_k_times_the_error_in_the_heading_frame(process, variant, gains):
    _, x_dim, yaw = variant
    rng = np.random.default_rng(6)
    for _ in range(10):
        x, x_ref = rng.uniform(-0.8, 0.8, size=(2, x_dim))
        send(process, variant, "/ref", x_ref)
        send(process, variant, "/state", x)
        c, s = math.cos(x[yaw]), math.sin(x[yaw])
        turn = np.eye(x_dim)
        turn[0:2, 0:2] = turn[3:5, 3:5] = [[c, s], [-s, c]]
        control = process.published("/control/lqr")[-1]
        expected = np.array([0.0, 0.0, 0.0, 9.81]) + gains @ turn @ (x - x_ref)
        np.testing.assert_allclose(to_vector(control.control), expected, rtol=1e-9, atol=1e-9)
        assert control.header.stamp == process.clock.stamp()


def test_yaw_error_is_the_short_way_round(process, variant, gains):
    _, x_dim, yaw = variant
    x, x_ref = np.zeros((2, x_dim))
    x[yaw], x_ref[yaw] = 3.1, -3.1
    send(process, variant, "/ref", x_ref)
    send(process, variant, "/state", x)
    control = to_vector(process.published("/control/lqr")[-1].control)
    short = 6.2 - 2.0 * math.pi
    np.testing.assert_allclose(control, [0.0, 0.0, 0.0, 9.81] + gains[:, yaw] * short)


def test_is_silent_until_a_reference_has_arrived(process, variant):
    send(process, variant, "/state", np.zeros(variant[1]))
    assert process.published("/control/lqr") == []


def test_what_is_not_finite_is_ignored(process, variant):
    x_dim = variant[1]
    send(process, variant, "/ref", np.zeros(x_dim))
    for index in range(x_dim):
        state, reference = np.zeros((2, x_dim))
        state[index], reference[index] = math.inf, math.nan
        send(process, variant, "/state", state)
        send(process, variant, "/ref", reference)
    assert process.published("/control/lqr") == []
    assert len(process.logged("warn")) == 2


def test_after_bad_references_it_stays_where_it_is_and_looks_where_it_looks(process, variant):
    _, x_dim, yaw = variant
    send(process, variant, "/ref", np.ones(x_dim))
    send(process, variant, "/ref", np.full(x_dim, math.nan))
    process.advance(0.51)
    x = np.zeros(x_dim)
    x[[0, 1, 2, yaw]] = 0.1, 0.2, 0.3, 0.4
    send(process, variant, "/state", x)
    control = process.published("/control/lqr")[-1].control
    np.testing.assert_allclose(to_vector(control), [0.0, 0.0, 0.0, 9.81])
