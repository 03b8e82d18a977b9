"""The figure eight of the demo: from the hover point and back to it, at rest, and once around."""

import math

import numpy as np
import pytest
import rospkg
from std_srvs.srv import EmptyRequest

from crazyflie_dev.demo import (
    EIGHT_DURATION,
    HOVER,
    LAUNCH_FILE,
    REFERENCE_PERIOD,
    eight,
    say_if_busy,
)
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing import launch_files
from crazyflie_utils.vectors import to_vector

LAUNCH = rospkg.RosPack().get_path(LAUNCH_FILE[0]) + "/launch/" + LAUNCH_FILE[1]


def position(moment):
    """Return x, y, z at a time since the begin of the figure."""
    reference = eight(moment)
    return np.array([reference.x, reference.y, reference.z])


@pytest.mark.parametrize(("load", "is_busy"), [(1.9, False), (2.1, True)])
def test_a_busy_computer_is_reported(load, is_busy, capsys):
    say_if_busy(load, processors=2)
    assert ("too busy: 2.1 programs" in capsys.readouterr().err) == is_busy


@pytest.mark.parametrize(("moment", "yaw"), [(0.0, 0.0), (EIGHT_DURATION, 2.0 * math.pi)])
def test_begins_and_ends_at_rest_at_the_hover_point(moment, yaw):
    reference = eight(moment)
    assert position(moment) == pytest.approx(HOVER, abs=1e-9)
    assert (reference.x_dot, reference.y_dot) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert reference.yaw == pytest.approx(yaw)


@pytest.mark.parametrize("moment", np.linspace(0.1, EIGHT_DURATION - 0.1, 20))
def test_velocities_are_those_of_the_positions(moment):
    step = 1e-5
    slope = (position(moment + step) - position(moment - step)) / (2.0 * step)
    reference = eight(moment)
    assert (reference.x_dot, reference.y_dot) == pytest.approx(slope[:2], abs=1e-6)
    # Largest velocity of a reference that the controller accepts (m/s).
    assert math.hypot(*slope) < 2.0


def turned(reference):
    return "/ref/position_velocity_yaw", PositionVelocityYawStateStamped(state=reference)


def straight(reference):
    numbers = to_vector(reference)[:6]
    return "/ref", PositionVelocityStateStamped(state=PositionVelocityState(*numbers))


@pytest.mark.parametrize(
    ("controller", "dynamics", "message"),
    [
        ("position_velocity_yaw", "coupled_7d", turned),
        ("lift", "coupled_7d", straight),
        ("lift", "near_hover", straight),
    ],
)
def test_the_nodes_fly_it_calmly(controller, dynamics, message):
    process = launch_files.launch(LAUNCH, controller=controller, dynamics=dynamics)
    process.advance(1.0)
    process.call("/takeoff", EmptyRequest())
    process.advance(9.0)
    hover = [to_vector(each.state)[:3] for each in process.published("/state")[-200:]]
    begin, errors = len(process.published("/control/final")), []
    for moment in np.arange(0.0, EIGHT_DURATION, REFERENCE_PERIOD):
        process.publish(*message(eight(moment)))
        process.advance(REFERENCE_PERIOD)
        state = to_vector(process.published("/state")[-1].state)
        errors.append(math.dist(state[:3], position(moment)))
    controls = [to_vector(each.control) for each in process.published("/control/final")]
    assert max(math.dist(each, HOVER) for each in hover) < 0.01
    assert math.sqrt(np.mean(np.square(errors))) < 0.06
    flown = np.array(controls[begin:])
    assert len(flown) > 550
    assert np.abs(np.diff(flown[:, :2], axis=0)).mean() < 0.01
    # Measured from the controller's first control on, including the climb.
    flying = np.array([each for each in controls if each[3] > MIN_THRUST / 2.0])
    assert np.abs(flying[:, :2]).max() < MAX_TILT - 1e-6
    assert MIN_THRUST < flying[:, 3].min() and flying[:, 3].max() < MAX_THRUST
