"""Takeoff after takeoff of the hover stack, on hand-moved time."""

from pathlib import Path

import hover_graph
import pytest
from rospkg import RosPack
from std_srvs.srv import EmptyRequest

from crazyflie_lqr.lqr_nodes import (
    PositionVelocityYawStateLiftLqrNode,
)
from crazyflie_reports.flight_record import OVERSHOOT_LIMIT
from crazyflie_simulator.quadrotor_simulator_node import QuadrotorSimulatorNode
from crazyflie_state_estimator.estimator_node import PositionVelocityYawStateEstimatorNode
from crazyflie_takeoff.takeoff_control_filter_node import TakeoffControlFilterNode
from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils.testing import FakeProcess

LQR = Path(RosPack().get_path("crazyflie_lqr"))
HEIGHT = 1.0
FRAMES = {"frames/fixed": "world", "frames/robot": "crazyflie"}

# Values of the launch files: gains, integrator of x, y, z and its limits, filter.
HARDWARE = ("references/K_manual.txt", (-0.05, 0.05, -0.5), (1.0, 1.0, 6.0), "kalman")
SOFTWARE = ("config/K_quadrotor.txt", (-0.15, 0.15, -10.0), (0.2, 0.2, 0.25), "finite_difference")


def launch(example, mass_error, thrust_error, height=HEIGHT):
    """Return a process with vehicle, estimator, controller, server and filter."""
    gains_file, gains, limits, rate_filter = example
    process = FakeProcess()
    simulator = {
        **{"time_step": 0.01, "init/x": 0.0, "init/y": 0.0, "init/z": 0.0, **FRAMES},
        **{"topics/control": "/control/final", "mass_error": mass_error},
        "thrust_error": thrust_error,
    }
    if example is HARDWARE:
        simulator |= {"mocap/position_noise": 0.0002, "mocap/latency": 0.02}
    estimator = {
        **{"x_dim": 7, "time_step": 0.01, **FRAMES, "topics/state": "/state"},
        **{"topics/control": "/control/final", "filter/type": rate_filter},
    }
    controller = {
        **{"x_dim": 7, "u_dim": 4, "K_file": str(LQR / gains_file)},
        **{"u_ref_file": str(LQR / "config/u_ref_hover.txt"), "topics/reference": "/ref"},
        **{"topics/state": "/state", "topics/control": "/control/lqr"},
        **{f"integrator/k/{axis}": k for axis, k in zip("xyz", gains, strict=True)},
        **{f"integrator/thresh/{axis}": i for axis, i in zip("xyz", limits, strict=True)},
    }
    server = {
        **{"topics/reference": "/ref", "topics/control": "/control/takeoff"},
        **{"topics/in_flight": "/in_flight", "topics/state": "/state"},
        **{"hover/x": 0.0, "hover/y": 0.0, "hover/z": height, "landing/descent_speed": 0.2},
    }
    control_filter = {
        **{"topics/takeoff_control": "/control/takeoff", "topics/in_flight": "/in_flight"},
        **{"topics/commanded_control": "/control/lqr", "topics/final_control": "/control/final"},
    }
    nodes = {
        "/simulator": (QuadrotorSimulatorNode(), simulator),
        "/state_estimator": (PositionVelocityYawStateEstimatorNode(), estimator),
        "/lqr_controller": (PositionVelocityYawStateLiftLqrNode(), controller),
        "/takeoff_server": (TakeoffServerNode(), server),
        "/takeoff_control_filter": (TakeoffControlFilterNode(), control_filter),
    }
    for name, (node, parameters) in nodes.items():
        assert process.launch(node, name, parameters)
    process.advance(2.0)
    return process


def heights(process, duration):
    """Advance the time; return the heights of the vehicle."""
    before = len(process.published("/tf"))
    process.advance(duration)
    messages = process.published("/tf")[before:]
    return [transform.transform.translation.z for m in messages for transform in m.transforms]


@pytest.mark.parametrize("example", [HARDWARE, SOFTWARE], ids=["hardware", "software"])
@pytest.mark.parametrize(
    ("mass_error", "thrust_error"),
    [(0.05, -0.05), pytest.param(0.0, 0.0, marks=pytest.mark.long)],
)
def test_no_takeoff_overshoots_also_not_after_30_s_on_the_ground(example, mass_error, thrust_error):
    process = launch(example, mass_error, thrust_error)
    for wait in (0.0, 18.0):
        process.advance(wait)
        takeoff = process.call("/takeoff", EmptyRequest())
        course = heights(process, 12.0)
        assert takeoff.exception(timeout=0) is None
        assert max(course) < HEIGHT + OVERSHOOT_LIMIT
        assert course[-1] == pytest.approx(HEIGHT, abs=0.05)
        land = process.call("/land", EmptyRequest())
        assert heights(process, 12.0)[-1] < 0.01
        assert land.exception(timeout=0) is None


@pytest.mark.parametrize("height", [0.15, 0.3, 1.0])
@pytest.mark.parametrize("hover", [0.65, 30000 / 42000, 36000 / 42000, 1.3])
def test_no_takeoff_passes_its_hover_point_whatever_thrust_the_vehicle_needs(hover, height):
    """It hovers at this fraction of the assumed thrust: 36,000 PWM in place of 42,000 are usual."""
    strength = min(1.0 / hover, 1.5)
    process = launch(HARDWARE, strength * hover - 1.0, strength - 1.0, height)
    takeoff = process.call("/takeoff", EmptyRequest())
    course = heights(process, 12.0)
    assert takeoff.exception(timeout=0) is None
    assert max(course) < height + 0.15
    assert course[-1] == pytest.approx(height, abs=0.05)
    # It does not fall back to the ground.
    assert min(course[course.index(max(course)) :]) > 0.6 * height


def test_a_controller_follows_the_flight_of_its_namespace_whatever_its_topic_is_called():
    """Its launch file names the topic for the takeoff server and the filter only."""
    flight = hover_graph.HoverGraph(
        0.05,
        ["/lqr_controller/topics/in_flight"],
        in_flight_topic="/in_flightHY4",
        **hover_graph.HARDWARE,
    )
    flight.take_off(12.0)
    assert max(z for _, _, z in flight.course) < HEIGHT + 0.1
