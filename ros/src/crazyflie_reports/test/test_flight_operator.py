"""The operator of a flight whose messages are later than the answers of its services."""

import threading
from concurrent.futures import Future
from types import SimpleNamespace

import genpy
import pytest

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    FlightStatus,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_reports.flight_operator import FlightError, FlightOperator


class LateVehicle:
    """A process, and its handle, whose services answer at once; the flight is heard later."""

    def __init__(self):
        self.callbacks = {}
        self.messages = ()  #: Calls of `show` and `announce` after an answer.

    def handle(self, name):
        return self

    def start(self):
        pass

    def get_param(self, name, kind, default):
        return default

    def subscribe(self, topic, message_type, callback):
        self.callbacks[topic] = callback

    def publisher(self, topic, message_type):
        return SimpleNamespace()

    def call_service(self, *_):
        answer = Future()
        answer.set_result(None)
        threading.Timer(
            0.05, lambda: [act(*arguments) for act, *arguments in self.messages]
        ).start()
        return answer

    def show(self, time, thrust):
        stamp = genpy.Time.from_sec(time)
        state = PositionVelocityYawStateStamped(state=PositionVelocityYawState(z=1.0))
        control = ControlStamped(control=Control(thrust=thrust))
        state.header.stamp = control.header.stamp = stamp
        self.callbacks["state"](state)
        self.callbacks["control/final"](control)

    def announce(self, time, state):
        status = FlightStatus(state=state)
        status.header.stamp = genpy.Time.from_sec(time)
        self.callbacks["/in_flight_flight_status"](status)


@pytest.fixture
def vehicle():
    return LateVehicle()


@pytest.fixture
def operator(vehicle):
    return FlightOperator(vehicle, limit=0.5)


def test_events_are_those_of_the_flight_although_its_messages_are_late(vehicle, operator):
    vehicle.announce(0.5, FlightStatus.ON_GROUND)
    vehicle.show(1.0, 0.0)
    vehicle.messages = [
        (vehicle.announce, 1.5, FlightStatus.TAKING_OFF),
        (vehicle.announce, 7.5, FlightStatus.FLYING),
        (vehicle.show, 7.0, 9.81),
        (vehicle.show, 7.75, 9.81),
    ]
    operator.takeoff()
    vehicle.messages = [
        (vehicle.show, 12.0, 9.81),
        (vehicle.announce, 13.0, FlightStatus.ON_GROUND),
        (vehicle.show, 13.0, 4.0),
        (vehicle.show, 13.5, 0.0),
    ]
    operator.land()
    record = operator.finish()
    assert record.events == {"takeoff": 1.0, "flying": 7.5, "land": 7.75, "landed": 13.0}
    assert record.final_control.last[3] == 0.0


def test_a_server_that_answers_and_does_not_fly(vehicle, operator):
    vehicle.announce(0.5, FlightStatus.ON_GROUND)
    vehicle.show(1.0, 0.0)
    with pytest.raises(FlightError, match="has answered takeoff, and was not flying"):
        operator.takeoff()


def test_a_server_without_typed_states(vehicle, operator):
    vehicle.show(1.0, 0.0)
    operator.takeoff()
    assert operator.record.events == {"takeoff": 1.0, "flying": 1.0}
