"""The lift controller on a fake process, for its tests."""

from pathlib import Path

from crazyflie_lqr.lqr_nodes import (
    PositionVelocityYawStateLiftLqrNode,
)
from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
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

LIFT = {"integrator/k/z": -0.5, "integrator/thresh/z": 6.0}


def launch(**changes):
    """Return a process with a controller in it."""
    process = FakeProcess()
    node = PositionVelocityYawStateLiftLqrNode()
    assert process.launch(node, "/lqr_controller", {**PARAMETERS, **changes})
    return process


def lifting(**changes):
    """Return a process whose controller integrates the height."""
    return launch(**LIFT, **changes)


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


def publish_flight_state(process, state):
    status = FlightStatus(state=getattr(FlightStatus, state.upper()))
    process.publish("/in_flight_flight_status", status)
