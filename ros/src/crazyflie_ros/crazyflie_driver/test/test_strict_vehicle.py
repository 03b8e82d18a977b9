"""The driver on the virtual vehicle, which locks itself as the firmware does; in real time."""

import threading

import pytest
from genpy import Duration
from geometry_msgs.msg import Twist, Vector3
from std_msgs.msg import Empty

from crazyflie_driver.msg import Position
from crazyflie_driver.srv import LandRequest, NotifySetpointsStopRequest, TakeoffRequest
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.log import LogBlock
from crazyflie_model.supervisor import SupervisorState
from crazyflie_model.units import GRAVITY, pwm_from_thrust
from crazyflie_utils.testing.programs import LIMIT, wait_until
from crazyflie_virtual.testing import virtual_vehicle

PERIOD = 0.02
HEIGHT = 0.5
LOCK_TIME = 2.5
"""Silence after which the firmware has locked itself, s of the vehicle's own time."""


class Flight:
    """A vehicle that is added to a server, with the vehicle's time, and a stream of positions."""

    def __init__(self, server, virtual, uri):
        self.server, self.uri, self.virtual = server, uri, virtual
        self.heights = []
        self.state = SupervisorState(0)
        server.add(uri)
        self.crazyflie = server.node._vehicles[uri].crazyflie
        self._log(self.crazyflie)

    def _log(self, crazyflie):
        variables = ("stateEstimate.z", "supervisor.info")
        crazyflie.add_log_block(LogBlock("test", 20, variables, self._note))

    def _note(self, _, values):
        self.heights.append(values[0])
        self.state = SupervisorState(values[1])

    @property
    def time(self):
        """How far the vehicle has come, s."""
        return self.virtual.vehicle.time

    def wait(self, duration):
        """Advance the vehicle's time; no node sends anything."""
        end = self.time + duration
        wait_until(lambda: self.time >= end, f"{duration} s of the vehicle's time", period=0.002)

    def thrust(self, height):
        """Send the level thrust of a controller of the height (m)."""
        truth = self.virtual.observe()
        thrust = GRAVITY + 6.0 * (height - truth.position[2]) - 5.0 * truth.velocity[2]
        twist = Twist(linear=Vector3(z=pwm_from_thrust(min(max(thrust, 1.0), 13.0))))
        self.server.process.publish("/cf1/cmd_vel", twist)

    def hover_on_thrust(self, height, duration):
        """Unlock the thrust and hover, at a height (m), for a time (s)."""
        self.server.process.publish("/cf1/cmd_vel", Twist())
        self.run(duration, height, send=self.thrust)

    def position(self, height):
        """Send a position at a height (m)."""
        self.server.process.publish("/cf1/cmd_position", Position(z=height))

    def run(self, duration, height=None, until=lambda: False, send=None):
        """Advance the time, streaming setpoints, positions by default, if a height is given."""
        end, step = self.time + duration, PERIOD
        while (begin := self.time) < end and not until():
            self.server.process.advance(step)
            if height is not None:
                (send or self.position)(height)
            self.wait(PERIOD)
            # On a busy machine the vehicle comes further, and the driver's clock goes with it.
            step = self.time - begin

    def climb(self):
        self.run(LIMIT, HEIGHT, lambda: self.heights and self.heights[-1] > 0.9 * HEIGHT)
        assert self.heights[-1] > 0.9 * HEIGHT
        self.run(0.5, HEIGHT)

    def seen_by_another(self):
        """Return the state that a new client is told."""
        with Crazyflie(self.uri) as other:
            return other.supervisor.read()


@pytest.fixture
def flight(server):
    with virtual_vehicle() as (virtual, uri):
        yield Flight(server, virtual, uri)


def remove(flight):
    """Remove the vehicle; return how long it took to sink."""
    removing = threading.Thread(target=flight.server.remove, args=(flight.uri,))
    begin, count = flight.time, len(flight.heights)
    removing.start()
    sunk = None
    while removing.is_alive():
        flight.run(PERIOD)
        if sunk is None and flight.heights[count:] and flight.heights[-1] < 0.05:
            sunk = flight.time - begin
    return sunk


def test_a_vehicle_that_was_added_and_removed_can_fly(flight):
    flight.run(LOCK_TIME)
    assert SupervisorState.LOCKED not in flight.state
    remove(flight)
    flight.wait(LOCK_TIME)
    assert SupervisorState.LOCKED not in flight.seen_by_another()


def test_a_removal_in_flight_is_a_landing_and_locks_nothing(flight):
    flight.climb()
    # A fall would take a third of a second, the landing takes three.
    assert remove(flight) > 1.5
    flight.wait(LOCK_TIME)
    assert SupervisorState.LOCKED not in flight.seen_by_another()


def test_a_streamed_flight_survives_a_second_of_silence(flight):
    flight.climb()
    # The link is kept for 1.45 s from the last word before to the first one after; what is between
    # these and the silence is the machine's.
    flight.virtual.switches.silence = 1.0
    count = len(flight.heights)
    flight.run(4.0, HEIGHT)
    assert SupervisorState.FLYING in flight.state
    assert SupervisorState.LOCKED not in flight.state
    assert min(flight.heights[count:]) > 0.5 * HEIGHT
    assert flight.crazyflie.connection_count == 1


def test_a_notice_after_zero_thrust_that_is_lost_locks_nothing(flight, monkeypatch):
    flight.hover_on_thrust(0.3, 1.5)
    setpoints = flight.crazyflie.setpoints
    send, lost = setpoints.notify_setpoints_stop, []

    def lose_first(*arguments):
        # UDP does not acknowledge it.
        if lost:
            send(*arguments)
        else:
            lost.append(arguments)

    monkeypatch.setattr(setpoints, "notify_setpoints_stop", lose_first)
    flight.server.process.publish("/cf1/cmd_vel", Twist())
    flight.run(LOCK_TIME)
    assert len(lost) == 1
    assert SupervisorState.LOCKED not in flight.seen_by_another()


@pytest.mark.parametrize("gap", [1.0, 2.4])
def test_a_stream_of_thrust_that_pauses_flies_on(flight, gap):
    """Such as while the filter or the converter is started again, on a busy machine."""
    flight.hover_on_thrust(1.0, 4.0)
    assert flight.virtual.observe().position[2] == pytest.approx(1.0, abs=0.1)
    count = len(flight.heights)
    flight.run(gap)
    flight.run(2.0, 1.0, send=flight.thrust)
    assert SupervisorState.LOCKED not in flight.state
    assert min(flight.heights[count:]) > 0.2
    assert flight.virtual.observe().position[2] == pytest.approx(1.0, abs=0.1)


def test_a_stream_of_thrust_that_ends_in_flight_lets_the_vehicle_sink(flight):
    flight.hover_on_thrust(1.0, 4.0)
    speeds = []

    def is_down():
        truth = flight.virtual.observe()
        speeds.append(-truth.velocity[2])
        return truth.position[2] < 0.02

    flight.run(LIMIT, until=is_down)
    # A fall from there would end with 4.4 m/s.
    assert 0.5 < max(speeds) < 2.5
    flight.wait(LOCK_TIME + 1.0)
    assert not any(flight.virtual.vehicle.board.firmware.stabilizer.commands)


def test_a_setpoint_that_comes_after_cmd_stop_locks_nothing(flight):
    flight.run(0.5, 0.0)
    flight.server.process.publish("/cf1/cmd_stop", Empty())
    flight.server.process.publish("/cf1/cmd_position", Position())
    flight.run(LOCK_TIME)
    assert SupervisorState.LOCKED not in flight.seen_by_another()


def test_users_may_announce_the_landing_first(flight):
    flight.climb()
    flight.server.call("/cf1/notify_setpoints_stop", NotifySetpointsStopRequest(0, 0))
    flight.run(0.3)
    assert flight.heights[-1] > 0.8 * HEIGHT
    flight.server.call("/cf1/land", LandRequest(0, 0.0, Duration(2)))
    flight.run(1.0)
    assert flight.heights[-1] > 0.1 * HEIGHT
    flight.run(LIMIT, until=lambda: SupervisorState.FLYING not in flight.state)
    flight.run(0.5)
    flight.server.call("/cf1/takeoff", TakeoffRequest(0, HEIGHT, Duration(1)))
    flight.run(LIMIT, until=lambda: flight.heights[-1] > 0.8 * HEIGHT)
    assert flight.heights[-1] > 0.8 * HEIGHT


def test_a_takeoff_waits_for_the_moment_after_a_landing_in_which_the_firmware_refuses(flight):
    flight.server.call("/cf1/takeoff", TakeoffRequest(0, HEIGHT, Duration(1)))
    flight.run(1.5)
    flight.server.call("/cf1/land", LandRequest(0, 0.0, Duration(1)))
    supervisor = flight.virtual.vehicle.board.firmware.supervisor
    wait_until(lambda: not supervisor.can_fly, "the firmware to refuse", period=0.001)
    flight.server.call("/cf1/takeoff", TakeoffRequest(0, HEIGHT, Duration(1)))
    flight.run(LIMIT, until=lambda: flight.virtual.observe().position[2] > 0.8 * HEIGHT)
    assert flight.virtual.observe().position[2] > 0.8 * HEIGHT


@pytest.mark.parametrize("protocol", [11, 12])
@pytest.mark.filterwarnings("ignore:The supervisor subsystem:UserWarning")
def test_nothing_starts_the_motors_after_a_touchdown(server, protocol):
    with virtual_vehicle(protocol=protocol) as (virtual, uri):
        flight = Flight(server, virtual, uri)
        stabilizer = virtual.vehicle.board.firmware.stabilizer
        server.call("/cf1/takeoff", TakeoffRequest(0, HEIGHT, Duration(1)))
        flight.run(2.0)
        server.call("/cf1/land", LandRequest(0, 0.0, Duration(1)))
        flight.run(LIMIT, until=lambda: not any(stabilizer.commands))
        flight.run(0.3)
        assert SupervisorState.FLYING in flight.state
        server.node.prepare_shutdown()
        removing = threading.Thread(target=server.remove, args=(uri,))
        removing.start()
        while removing.is_alive():
            flight.run(PERIOD)
            assert not any(stabilizer.commands)
        flight.wait(LOCK_TIME)
        assert not any(stabilizer.commands)
        assert SupervisorState.LOCKED not in virtual.vehicle.board.firmware.supervisor.flags


def test_the_emergency_watchdog_ends_a_flight_without_a_pc(make_server):
    with virtual_vehicle() as (virtual, uri):
        flight = Flight(make_server({"emergency_watchdog": True}), virtual, uri)
        flight.server.call("/cf1/takeoff", TakeoffRequest(0, HEIGHT, Duration(1)))
        flight.run(2.5)
        assert virtual.observe().position[2] > 0.8 * HEIGHT
        # Without a word, as when the PC dies.
        flight.crazyflie.close()
        flight.run(2.5)
        assert virtual.observe().position[2] < 0.05
        assert SupervisorState.LOCKED in flight.seen_by_another()


def test_a_vehicle_that_does_not_arm_itself_takes_off(make_server):
    with virtual_vehicle(positioning="deck", auto_arm=False) as (virtual, uri):
        flight = Flight(make_server(), virtual, uri)
        flight.server.call("/cf1/takeoff", TakeoffRequest(0, HEIGHT, Duration(1)))
        flight.run(LIMIT, until=lambda: flight.heights[-1] > 0.8 * HEIGHT)
        assert flight.heights[-1] > 0.8 * HEIGHT
