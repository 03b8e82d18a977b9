"""Which vehicles behind the driver are held."""

import numpy as np
import pytest

from crazyflie_mission_api.mission_vehicle import (
    AttitudeSetpoint,
    FullStateSetpoint,
    HoverSetpoint,
    PositionSetpoint,
    VelocityWorldSetpoint,
    led_to,
)
from crazyflie_mission_api.ros_vehicle import TimedPose
from crazyflie_py.separation_watch import SeparationWatch

STEP = 0.05
LEVEL = (0.0, 0.0, 0.0, 1.0)


class Vehicle:
    """Flies with a velocity, m/s, until it is held."""

    def __init__(self, name, position, velocity=(0.0, 0.0, 0.0)):
        self.name = name
        self.position, self.velocity = np.array(position, dtype=float), np.array(velocity)
        self.time = 0.0
        self.goal = None
        self.may_be_held = True
        self.places = []
        self.is_known = True

    def pose(self):
        return TimedPose(tuple(self.position), LEVEL, self.time) if self.is_known else None

    def streamed_goal(self, place):
        return self.goal

    def hold(self, place):
        self.places.append(place)

    def release(self):
        self.places.append(None)


class Connection:
    """Keeps warnings."""

    def __init__(self, is_unchecked=False):
        self.is_unchecked = is_unchecked
        self.handle = self
        self.warnings = []

    def warn(self, text, throttle, key):
        self.warnings.append(text)


def fly(vehicles, duration, connection=None):
    """Advance the time, s; return the warnings."""
    connection = connection or Connection()
    watch = SeparationWatch(vehicles, [0.15] * len(vehicles), connection)
    for _ in range(round(duration / STEP)):
        watch.update()
        for vehicle in vehicles:
            vehicle.time += STEP
            vehicle.position = vehicle.position + STEP * vehicle.velocity
    return connection.warnings


def test_the_one_that_approaches_is_held_in_time():
    one, two = Vehicle("cf1", (0.01, 0, 1), (0.5, 0, 0)), Vehicle("cf2", (1, 0, 1))
    assert fly([one, two], 1.0) == [
        "cf1 comes too near to cf2, now or in 0.5 s: 0.54 m; expected at least 0.30 m "
        "(vertical distances are halved); the vehicle is held"
    ]
    assert one.places == [pytest.approx((0.46, 0.0, 1.0))]
    assert two.places == []


def test_vehicles_that_pass_or_part_are_not_held():
    one, two = Vehicle("cf1", (0, 0, 1), (0.5, 0, 0)), Vehicle("cf2", (1, 0.4, 1))
    assert fly([one, two], 3.0) == []
    one, two = Vehicle("cf1", (0, 0, 1), (-0.5, 0, 0)), Vehicle("cf2", (0.2, 0, 1))
    assert fly([one, two], 1.0) == []


@pytest.mark.parametrize("why", ["lands", "unknown", "unchecked"])
def test_who_is_not_held(why):
    one, two = Vehicle("cf1", (0, 0, 1), (0.5, 0, 0)), Vehicle("cf2", (1, 0, 1))
    one.may_be_held = why != "lands"
    two.is_known = why != "unknown"
    warnings = fly([one, two], 1.0, Connection(why == "unchecked"))
    assert one.places == []
    assert [text.rpartition("; ")[2] for text in warnings] == (
        ["the vehicle flies on"] if why == "unchecked" else []
    )


def test_setpoints_are_followed_again_when_they_lead_away():
    one, two = Vehicle("cf1", (0.75, 0, 1)), Vehicle("cf2", (1, 0, 1))
    watch = SeparationWatch([one, two], [0.15, 0.15], Connection())
    one.goal = (1.0, 0.0, 1.0)
    for _ in range(3):
        watch.update()
    assert one.places == [pytest.approx((0.75, 0.0, 1.0))]
    one.goal = (0.5, 0.0, 1.0)
    watch.update()
    assert one.places[1:] == [None]


@pytest.mark.parametrize(
    ("setpoint", "expected"),
    [
        (PositionSetpoint((1.0, 2.0, 3.0), 0.0), (1.0, 2.0, 3.0)),
        (FullStateSetpoint((1.0, 2.0, 3.0), *[(0.0,) * 3] * 2, 0.0, (0.0,) * 3), (1.0, 2.0, 3.0)),
        (VelocityWorldSetpoint((1.0, 0.0, -1.0), 0.0), (0.5, 0.0, 0.5)),
        # To the left of a vehicle that faces +y.
        (HoverSetpoint(0.0, 1.0, 0.0, 0.7), (-0.5, 0.0, 0.7)),
        (AttitudeSetpoint(0.0, 0.0, 0.0, 40000.0), None),
    ],
)
def test_where_setpoints_lead(setpoint, expected):
    found = led_to(setpoint, (0.0, 0.0, 1.0), np.pi / 2, 0.5)
    assert found == (expected if expected is None else pytest.approx(expected))
