"""A flight by joystick on simulated time: off the ground, against a wall, along it, and down."""

import pytest
from sensor_msgs.msg import Joy

from crazyflie_msgs.msg import FlightStatus, PositionVelocityYawStateStamped
from crazyflie_reports.flight_operator import ready_operator
from crazyflie_utils.testing import peer

WALL = 1.5  #: Its x, m.


def joy(forward=0.0, left=0.0, button=None):
    """Return what a joystick says while it is held so."""
    return Joy(axes=[0, 0, 0, left, forward], buttons=[k == button for k in range(3)])


def press(button, state):
    """Hold a button until the takeoff server is in a state."""
    peer.exchange(
        {"/joy": joy(button=button)},
        "/in_flight_flight_status",
        FlightStatus,
        lambda status: status.state == state,
    )


def hold(operator, accept, **axes):
    """Hold the stick until a state is accepted; return where the vehicle is then, m."""
    peer.exchange({"/joy": joy(**axes)}, "/state", PositionVelocityYawStateStamped, accept)
    return operator.position.copy()


def after(seconds):
    """Return what accepts a state when simulated time has passed."""
    first = []

    def accept(message):
        first.append(message.header.stamp.to_sec())
        return first[-1] - first[0] > seconds

    return accept


@pytest.fixture(scope="module")
def flight():
    """Fly once; return the record, and where the vehicle was at the turns."""
    with ready_operator() as operator:
        press(2, FlightStatus.FLYING)
        places = [operator.position.copy()]
        hold(operator, lambda m: m.state.x > WALL - 0.7, forward=1.0)
        places += [hold(operator, after(seconds), forward=1.0) for seconds in (3.0, 0.5)]
        places.append(hold(operator, lambda m: m.state.y > 0.4, forward=1.0, left=1.0))
        press(0, FlightStatus.ON_GROUND)
        operator.hover(0.5)
        places.append(operator.position.copy())
        yield operator.finish(), places


def test_the_button_takes_off(flight):
    assert flight[1][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.1)


def test_the_stick_flies(flight):
    speeds = flight[0].state.column("x_dot")
    # A full deflection is 0.5 m/s; the vehicle overshoots.
    assert 0.45 < speeds.max() < 0.8


def test_stops_before_the_wall_though_the_stick_goes_on(flight):
    _, before, later, *_ = flight[1]
    assert WALL - flight[0].state.column("x").max() == pytest.approx(0.5, abs=0.1)
    assert later == pytest.approx(before, abs=0.03)


def test_flies_along_the_wall(flight):
    along = flight[1][3]
    assert along[1] > 0.4
    assert WALL - along[0] == pytest.approx(0.5, abs=0.1)


def test_the_button_lands(flight):
    assert flight[1][-1][2] == pytest.approx(0.0, abs=0.05)
