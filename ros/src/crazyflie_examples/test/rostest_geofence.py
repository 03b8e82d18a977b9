"""Flights against the walls of the geofence."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
import rospy
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import ControlStamped
from crazyflie_reports.flight_operator import FlightOperator
from crazyflie_reports.flight_record import CONTROL_FIELDS, Series
from crazyflie_utils.main import ros_process
from crazyflie_utils.vectors import to_vector

PERIOD = 0.01
HOME = (0.0, 0.0, 1.0)
# Reference, and for how long, s.
OUTSIDE = [
    ((6.0, 0.0, 1.0), 4.0),
    ((-6.0, 0.0, 1.0), 4.0),
    ((0.0, 6.0, 1.0), 4.0),
    ((0.0, -6.0, 1.0), 4.0),
    ((0.0, 0.0, 9.0), 3.0),
    ((0.0, 0.0, -9.0), 3.0),
    ((6.0, 6.0, 9.0), 4.0),
    ((-6.0, -6.0, -9.0), 4.0),
    ((1.1, 0.0, 1.0), 4.0),
]
CLOSE = 0.08
"""How near to the walls it comes at least, m."""


@dataclass
class FenceFlight:
    """Recorded data: true positions, regular and final control, and the legs."""

    positions: Series
    regular: Series
    final: Series
    legs: list[tuple[float, float]]

    @property
    def start(self):
        return self.legs[0][0]

    @property
    def end(self):
        return self.legs[-1][1]

    def common_controls(self):
        """Return times, regular and final controls of the states that both answer."""
        regular = {round(t, 3): u for t, u in self._during(self.regular)}
        final = {round(t, 3): u for t, u in self._during(self.final)}
        times = sorted(set(regular) & set(final))
        return (
            np.array(times),
            np.array([regular[t] for t in times]),
            np.array([final[t] for t in times]),
        )

    def _during(self, series):
        rows = zip(series.times, series.values, strict=True)
        return [(t, u) for t, u in rows if self.start <= t <= self.end]


def record(process, flight):
    """Subscribe for a flight; return the handle to close."""
    handle = process.handle("/geofence_recorder")

    def on_transforms(message):
        for transform in message.transforms:
            if transform.child_frame_id == "crazyflie":
                at = transform.transform.translation
                flight.positions.append(transform.header.stamp.to_sec(), (at.x, at.y, at.z))

    def on_control(message):
        flight.regular.append(message.header.stamp.to_sec(), to_vector(message.control))

    handle.subscribe("/tf", TFMessage, on_transforms)
    handle.subscribe("/control/lqr", ControlStamped, on_control)
    return handle


@pytest.fixture(scope="module")
def flight():
    """Fly once, against every wall and then home."""
    process = ros_process()
    flight = FenceFlight(Series(("x", "y", "z")), Series(CONTROL_FIELDS), None, [])
    handle = record(process, flight)
    operator = FlightOperator(process)
    operator.wait_until_ready()
    operator.takeoff()
    for reference, duration in [*OUTSIDE, (HOME, 8.0)]:
        start = flight.positions.last_time
        operator.refer_to(reference)
        operator.hover(duration)
        flight.legs.append((start, flight.positions.last_time))
    flight.final = operator.finish().final_control
    handle.close()
    process.stop()
    return flight


@pytest.fixture(scope="module")
def box():
    """Return the corners, shape (2, 3), as launched."""
    corners = [rospy.get_param(f"/geofence/box/{end}") for end in ("min", "max")]
    return np.array([[corner[axis] for axis in "xyz"] for corner in corners])


def test_never_leaves_the_box(flight, box):
    positions = flight.positions.between(flight.start, flight.end)
    assert len(positions) > 0.9 * (flight.end - flight.start) / PERIOD
    assert np.all(positions > box[0])
    assert np.all(positions < box[1])


@pytest.mark.parametrize("number", range(len(OUTSIDE)))
def test_stays_close_to_the_walls_in_its_way(flight, box, number):
    reference = OUTSIDE[number][0]
    end = flight.legs[number][1]
    position = flight.positions.between(end - 0.5, end).mean(axis=0)
    # Where there is no wall in the way, the vehicle is where it should be.
    expected = np.clip(reference, *box)
    tolerance = np.where(expected == reference, 0.10, CLOSE)
    assert np.all(np.abs(position - expected) < tolerance)


def test_comes_home_undisturbed(flight):
    end = flight.legs[-1][1]
    positions = flight.positions.between(end - 1.0, end)
    # The integrator of the quadrotor's controller takes its time.
    assert max(math.dist(position, HOME) for position in positions) < 0.15
    times, regular, final = flight.common_controls()
    inside = times > end - 2.0
    assert inside.sum() > 100
    np.testing.assert_array_equal(final[inside], regular[inside])


def test_presses_smoothly_against_a_wall(flight):
    """Regular tilt or thrust is at its limit there; to and fro between both would be steps."""
    times, _, final = flight.common_controls()
    for _, end in flight.legs[:6]:
        pressed = final[(times > end - 1.0) & (times <= end)]
        steps = np.abs(np.diff(pressed, axis=0)).max(axis=0)
        assert max(steps[:2]) < 0.1
        assert steps[3] < 3.0
