"""A vehicle that is commanded to fly and does not lift off; the flights are in real time."""

import pytest
from conftest import LOG
from geometry_msgs.msg import Point, PointStamped, Pose, Quaternion
from safety_helpers import FLYING, LOCKED, READY, SETPOINTS_STOP, is_, wait_for_words

from crazyflie_driver.msg import FullState, Hover, Position
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.testing import virtual_vehicle

PERIOD = 0.02
HEIGHT = 0.5


class Stream:
    """Positions above the origin, in the vehicle's own time."""

    def __init__(self, server, virtual, uri):
        self.server, self.virtual = server, virtual
        self.top = 0.0
        server.add(uri, enable_parameters=False)

    @property
    def height(self):
        return self.virtual.observe().position[2]

    @property
    def warnings(self):
        return [each for each in self.server.process.logged("warn") if "lift" in each]

    @property
    def motors_run(self):
        return any(self.virtual.vehicle.board.firmware.stabilizer.commands)

    def run(self, duration, *messages):
        """Advance the time, with these messages (topic, message) repeatedly."""
        end = self.virtual.vehicle.time + duration
        while self.virtual.vehicle.time < end:
            self.server.process.advance(PERIOD)
            for topic, message in messages:
                self.server.process.publish(f"/cf1/{topic}", message)
            until = self.virtual.vehicle.time + PERIOD
            wait_until(lambda until=until: self.virtual.vehicle.time >= until, "time", period=0.002)
            self.top = max(self.top, self.height)

    def position(self, duration, yaw=0.0):
        self.run(duration, ("cmd_position", Position(z=HEIGHT, yaw=yaw)))


STANDING = {"stateEstimate.vz": ("f", 0.02), "stateEstimate.yaw": ("f", -10.0)}
"""The vehicle's estimate in addition to its height of 0.75 m; m/s, degrees."""

# (0, 0, z, w) with tan(yaw / 2) = z / w; its norm does not matter.
NORTH = FullState(pose=Pose(Point(0, 0, 1.0), Quaternion(0, 0, 0.5**0.5, 0.5**0.5)))


def stand(server, estimate, state):
    """Return a vehicle that stands, and says then that it is in another state."""
    vehicle = server.make_vehicle(log={**LOG, **estimate})
    is_(vehicle, READY)
    server.add(vehicle.uri)
    wait_for_words(server, "ready")
    is_(vehicle, state)
    vehicle.wait_for_packets(7, 1)
    vehicle.received.clear()
    return vehicle


def stream_until_warned(server, topic, message):
    """Return the warning."""

    def warnings():
        server.process.advance(0.1)
        server.process.publish(f"/cf1/{topic}", message)
        return [each for each in server.process.logged("warn") if "not lifted off" in each]

    wait_until(warnings, "the warning")
    return warnings()[0]


@pytest.mark.parametrize(
    ("topic", "message", "told"),
    [
        ("cmd_position", Position(z=1.0, yaw=30.0), r"cmd_position, 1.00 m, yaw 30 degrees"),
        ("cmd_hover", Hover(zDistance=1.5), "cmd_hover, 1.50 m"),
        ("cmd_full_state", NORTH, "cmd_full_state, 1.00 m, yaw 90 degrees"),
    ],
)
def test_what_was_told_and_what_is_measured_is_reported(server, topic, message, told):
    vehicle = stand(server, STANDING, FLYING)
    warning = stream_until_warned(server, topic, message)
    assert f"cf1: was commanded to fly ({told}), and has not lifted off" in warning
    assert "height 0.75 m, yaw -10 degrees" in warning
    assert vehicle.wait_for_packets(7, 1) == [SETPOINTS_STOP]
    sent = len(vehicle.packets(7, 0))
    server.process.publish(f"/cf1/{topic}", message)
    vehicle.wait_for_packets(15, 0, 2)
    assert len(vehicle.packets(7, 0)) == sent
    assert "did not lift off: pause the stream" in server.process.logged("warn")[-1]


@pytest.mark.parametrize(("yaw", "is_warned"), [(30.0, True), (-5.0, False), (355.0, False)])
def test_another_heading_than_that_on_the_ground_is_warned_of_at_once(server, yaw, is_warned):
    stand(server, STANDING, READY)

    def warnings():
        return [each for each in server.process.logged("warn") if "may not lift off" in each]

    server.process.publish("/cf1/cmd_position", Position(z=1.0, yaw=yaw))
    assert len(warnings()) == is_warned
    if is_warned:
        assert f"cf1: cmd_position commands yaw {yaw:.0f} degrees" in warnings()[0]
        assert "with yaw -10: " in warnings()[0]


def test_without_an_estimate_it_is_only_said(server):
    vehicle = stand(server, {}, LOCKED)
    assert "locked" in stream_until_warned(server, "cmd_position", Position(z=1.0))
    vehicle.wait_for_packets(15, 0, 2)
    assert vehicle.packets(7, 1) == []


@pytest.fixture
def stream(server):
    with virtual_vehicle() as (virtual, uri):
        yield Stream(server, virtual, uri)


def test_a_vehicle_that_does_not_lift_is_said_to_and_does_not_leap(stream):
    # The firmware turns before it climbs, and the ground holds the heading.
    stream.position(3.5, yaw=30.0)
    assert stream.top < 0.01
    (warning,) = [each for each in stream.warnings if "has not lifted off" in each]
    assert "cf1" in warning
    assert "0.50 m" in warning
    assert "yaw 30 degrees" in warning
    assert not stream.motors_run
    # Without the driver it would leap to 1.8 m now.
    stream.position(1.0)
    assert stream.top < 0.01
    # Silence of 1 s ends the stream; longer than 2 s would lock the vehicle, if it had not been
    # told that setpoints end.
    stream.run(2.5)
    state = stream.virtual.vehicle.board.firmware.supervisor.flags
    assert SupervisorState.LOCKED not in state
    stream.position(3.0)
    assert stream.height == pytest.approx(HEIGHT, abs=0.1)
    assert stream.top < HEIGHT + 0.25


def test_a_vehicle_that_flies_while_its_positions_stand_still_is_not_stopped(stream):
    """It climbs for ever, and would fall from where it is."""
    frozen = ("external_position", PointStamped())
    stream.run(3.0, frozen, ("cmd_position", Position(z=HEIGHT)))
    assert stream.motors_run
    assert stream.warnings == []
    assert stream.height > 2.0
