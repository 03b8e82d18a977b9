"""The fence against numbers that were calculated by hand, at four headings.

The box is 3 m by 2.2 m by 2.2 m, the margin 0.5 m, b = 1.5 m/s^2, T = 0.4 s, the rate 1 1/s.

At rest at the wall x = 1.5 m the stopping point is 0.5 m outside the inner box, the weight 1,
and the acceleration -0.5 / 0.4 = -1.25 m/s^2, for which a vehicle tilts by atan(1.25 / 9.81) =
0.12674 rad and needs a thrust of 9.81 / cos(0.12674) = 9.8893 m/s^2. At x = 1.25 m both are
half: weight 0.5, atan(0.625 / 9.81) = 0.06362 rad, 9.8299 m/s^2.

At y = 0.3 m with 1 m/s towards the wall y = 1.2 m the stopping point is at 0.3 + 0.4 + 1 / 3 =
1.0333 m, 0.3333 m outside; the weight is (2/3)^2 (3 - 4/3) = 0.7407; and the acceleration is
-(1 + 0.3333) / (0.4 + 1 / 1.5) = -1.25 m/s^2.
"""

import math

import numpy as np
import pytest

from crazyflie_geofence.geofence import Geofence
from crazyflie_geofence.geofence_node import GeofenceNode
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing import FakeProcess

FENCE = Geofence((-1.5, -1.0, 0.3), (1.5, 1.2, 2.5), 0.5, (1.5, 0.4), (4.0, 0.2), 1.0)
HOVER = np.array([0.0, 0.0, 0.3, 9.81])
EAST, NORTH, WEST, SOUTH = 0.0, math.pi / 2.0, math.pi, -math.pi / 2.0
TILT, HALF = 0.12674, 0.06362

# Positive roll accelerates to the right of the heading, positive pitch along it. The wall is in
# the east: who looks north has to go left.
AT_THE_EAST_WALL = [
    (EAST, 0.0, -TILT),
    (NORTH, -TILT, 0.0),
    (WEST, 0.0, TILT),
    (SOUTH, TILT, 0.0),
]
TOWARDS_THE_NORTH_WALL = [
    (EAST, TILT, 0.0),
    (NORTH, 0.0, -TILT),
    (WEST, -TILT, 0.0),
    (SOUTH, 0.0, TILT),
]


def fenced(position, velocity, yaw, regular=HOVER):
    return FENCE.control(np.array(position), np.array(velocity), yaw, np.array(regular))


@pytest.mark.parametrize(("yaw", "roll", "pitch"), AT_THE_EAST_WALL)
def test_at_rest_at_the_east_wall(yaw, roll, pitch):
    control, priority = fenced((1.5, 0.1, 1.4), (0.0, 0.0, 0.0), yaw)
    np.testing.assert_allclose(control, [roll, pitch, 0.3, 9.8893], atol=1e-4)
    assert priority == pytest.approx(1.0)


@pytest.mark.parametrize(("yaw", "roll", "pitch"), TOWARDS_THE_NORTH_WALL)
def test_flying_towards_the_north_wall(yaw, roll, pitch):
    control, priority = fenced((0.0, 0.3, 1.4), (0.0, 1.0, 0.0), yaw)
    np.testing.assert_allclose(control, [roll, pitch, 0.3, 9.8893], atol=1e-4)
    assert priority == pytest.approx(0.7407, abs=1e-4)


def test_half_way_through_the_margin_looking_north():
    control, priority = fenced((1.25, 0.1, 1.4), (0.0, 0.0, 0.0), NORTH)
    np.testing.assert_allclose(control, [-HALF, 0.0, 0.3, 9.8299], atol=1e-4)
    assert priority == pytest.approx(0.5)


def test_who_looks_north_may_fly_north_along_the_east_wall():
    # 0.1 rad of pitch lead north, 9.81 tan(0.1) = 0.984 m/s^2: that stays. The thrust is 9.81 m/s^2
    # tilted by 0.1 rad, so that it lifts 9.81 cos(0.1), also when it is tilted by the roll.
    control, priority = fenced((1.5, 0.1, 1.4), (0.0, 0.0, 0.0), NORTH, [0.0, 0.1, 0.3, 9.81])
    np.testing.assert_allclose(control, [-TILT, 0.1, 0.3, 9.8893], atol=1e-4)
    assert priority == pytest.approx(1.0)


@pytest.mark.parametrize(("yaw", "roll", "pitch"), AT_THE_EAST_WALL)
def test_the_node_takes_the_heading_of_the_state(yaw, roll, pitch):
    process = FakeProcess()
    box = {"min": (-1.5, -1.0, 0.3), "max": (1.5, 1.2, 2.5)}
    parameters = {
        f"box/{end}/{axis}": value
        for end, corner in box.items()
        for axis, value in zip("xyz", corner, strict=True)
    }
    parameters |= {"topics/state": "/state", "topics/control": "/control/lqr"}
    parameters |= {"topics/prioritized_control": "/control/geofence"}
    assert process.launch(GeofenceNode(), "/geofence", parameters)
    process.publish("/control/lqr", ControlStamped(control=Control(*HOVER)))
    state = PositionVelocityYawState(1.5, 0.1, 1.4, 0.0, 0.0, 0.0, yaw)
    process.publish("/state", PositionVelocityYawStateStamped(state=state))
    (message,) = process.published("/control/geofence")
    control = message.control.control
    assert (control.roll, control.pitch) == pytest.approx((roll, pitch), abs=1e-4)
    assert (control.yaw_dot, control.thrust) == pytest.approx((0.3, 9.8893), abs=1e-4)
    assert message.control.priority == pytest.approx(1.0)
