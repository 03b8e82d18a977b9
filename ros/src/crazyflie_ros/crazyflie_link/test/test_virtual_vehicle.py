"""A virtual vehicle, flown through the library in real time."""

import queue
import threading
import time

import pytest

from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import RefusedError
from crazyflie_link.log import LogBlock
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.testing import virtual_vehicle

LIMIT = 60.0


@pytest.fixture(scope="module")
def virtual():
    with virtual_vehicle() as virtual:
        yield virtual


class Client:
    """A link to the virtual vehicle, and what it logs."""

    def __init__(self, uri):
        self.states = queue.Queue()
        self.lines = queue.Queue()
        self._logged = {}
        self._changed = threading.Condition()
        self.link = Crazyflie(
            uri,
            reconnect=True,
            on_state=lambda state, text: self.states.put(state),
            on_console=self.lines.put,
        )
        self.link.connect()
        variables = ("stateEstimate.x", "stateEstimate.z", "supervisor.info", "pm.vbat")
        self.link.add_log_block(LogBlock("client", 20, variables, self._note))

    def wait_until(self, condition):
        """Wait until ``condition(x, z, state, voltage)`` holds."""
        with self._changed:
            assert self._changed.wait_for(
                lambda: self._logged and condition(*self._logged), LIMIT
            ), f"in the end: {self._logged}"

    def wait_for_state(self, state):
        while self.states.get(timeout=LIMIT) is not state:
            pass

    def _note(self, time_ms, values):
        x, z, info, voltage = values
        with self._changed:
            self._logged = (x, z, SupervisorState(info), voltage)
            self._changed.notify_all()


@pytest.fixture(scope="module")
def client(virtual):
    client = Client(virtual[1])
    yield client
    client.link.close()


def test_the_real_tables(client):
    assert client.link.log.variables()["stateEstimateZ.quat"] == "uint32_t"
    assert client.link.parameters.types()["ring.effect"] == ("uint8_t", True)
    assert len(client.link.parameters.values()) == len(client.link.parameters.types()) > 100
    assert client.link.parameters.write("ring.effect", 5) == 5
    assert client.link.parameters.read("ring.effect") == 5
    assert client.lines.get(timeout=LIMIT)
    client.wait_until(lambda x, z, state, voltage: 3.0 < voltage < 4.3)


def test_a_flight_by_commands_after_setpoints(client):
    link = client.link
    link.setpoints.send_zero_thrust()
    link.setpoints.notify_setpoints_stop()
    link.high_level.take_off(0.4, 1.0)
    client.wait_until(lambda x, z, state, _: z > 0.35 and SupervisorState.FLYING in state)
    link.trajectories.upload(1, 3, [PolynomialPiece(1.0, (0.0, 0.3), (), (), ())])
    link.high_level.start_trajectory(1, relative=True)
    client.wait_until(lambda x, z, *_: x > 0.2 and z > 0.3)
    link.high_level.land(0.0, 1.0)
    client.wait_until(lambda x, z, *_: z < 0.05)


def test_positive_yaw_rates_turn_clockwise(client):
    link = client.link
    yaws = queue.Queue()
    link.add_log_block(
        LogBlock("yaw", 20, ("stateEstimate.yaw",), lambda _, values: yaws.put(values[0]))
    )
    link.setpoints.send_zero_thrust()
    for send, arguments, turned in (
        (link.setpoints.hover, (0.0, 0.0, 60.0, 0.4), lambda yaw: -60.0 < yaw < -30.0),
        (link.setpoints.velocity_world, (0.0, 0.0, 0.0, -60.0), lambda yaw: -20.0 < yaw < 30.0),
    ):
        end = time.monotonic() + LIMIT
        while not turned(yaws.get(timeout=LIMIT)):
            send(*arguments)
            assert time.monotonic() < end
    link.setpoints.notify_setpoints_stop()
    link.high_level.land(0.0, 1.0)
    client.wait_until(lambda x, z, *_: z < 0.05)


def test_a_trajectory_that_was_never_defined_is_refused(client):
    with pytest.raises(RefusedError, match="start of the trajectory"):
        client.link.high_level.start_trajectory(77)


def test_silence_is_noticed_and_overcome(virtual, client):
    virtual[0].switches.silence = 1.0
    client.wait_for_state(LinkState.LOST)
    client.wait_for_state(LinkState.CONNECTED)
    with client._changed:
        client._logged = {}
    client.wait_until(lambda *_: True)


def test_after_an_emergency_stop_nothing_flies(client):
    client.link.supervisor.emergency_stop()
    client.wait_until(lambda x, z, state, _: SupervisorState.LOCKED in state)
    with pytest.raises(RefusedError, match="arming.*locked"):
        client.link.supervisor.arm()
