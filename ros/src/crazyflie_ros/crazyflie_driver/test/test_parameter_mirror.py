"""Parameters that are written to a vehicle, and again when it may have lost them."""

import threading
from types import SimpleNamespace

import pytest
from std_srvs.srv import SetBoolRequest

from crazyflie_driver.services import ParameterMirror
from crazyflie_driver.srv import UpdateParamsRequest
from crazyflie_link.errors import LinkLostError, NoReplyError, RefusedError
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess


class Firmware:
    """Parameters that remember what is written to them, or raise their error."""

    def __init__(self):
        self.written = []
        self.errors = {}

    def write(self, name, value):
        if name in self.errors:
            raise self.errors[name]
        self.written.append((name, value))
        return value


def test_settings_are_written_again_and_commands_are_not():
    process = FakeProcess({"/cf1/ring/effect": 7, "/cf1/kalman/resetEstimation": 1})
    firmware = Firmware()
    crazyflie = SimpleNamespace(parameters=firmware)
    mirror = ParameterMirror(process.handle("/server"), "/cf1", crazyflie)
    mirror.reapply_parameters()
    assert firmware.written == []
    mirror.write(["ring/effect", "kalman/resetEstimation"])
    firmware.written.clear()
    # Values that were set since, but not written, are ignored.
    process.transport.set_param("/cf1/ring/effect", 8)
    mirror.reapply_parameters()
    assert firmware.written == [("ring.effect", 7)]


@pytest.fixture
def mirror():
    """Return a mirror that has written three parameters, and the firmware."""
    names = ["ring/effect", "motor/trim", "sound/freq"]
    process = FakeProcess({f"/cf1/{name}": 7 for name in names})
    firmware = Firmware()
    crazyflie = SimpleNamespace(parameters=firmware)
    mirror = ParameterMirror(process.handle("/server"), "/cf1", crazyflie)
    mirror.write(names)
    firmware.written.clear()
    return mirror, firmware


@pytest.mark.parametrize("error", [RefusedError("writing ring.effect: no"), NoReplyError("none")])
def test_one_that_cannot_be_written_again_does_not_stop_the_others(mirror, error):
    mirror, firmware = mirror
    firmware.errors["ring.effect"] = error
    assert mirror.reapply_parameters() == [str(error)]
    assert firmware.written == [("motor.trim", 7), ("sound.freq", 7)]


def test_a_link_that_is_lost_meanwhile_stops_them(mirror):
    mirror, firmware = mirror
    firmware.errors["motor.trim"] = LinkLostError("gone")
    with pytest.raises(LinkLostError):
        mirror.reapply_parameters()


def test_a_master_that_is_frozen_does_not_block_the_jobs_of_a_vehicle(server, vehicle, monkeypatch):
    """It accepts connections, and never answers."""
    answers = threading.Event()
    monkeypatch.setattr(server.process.transport, "get_param", lambda name: answers.wait(20.0))
    monkeypatch.setattr("crazyflie_driver.services.MASTER_LIMIT", 0.1)
    names = ["effect", "ring/effect", "ring/neopixel"]
    update = server.process.call("/cf1/update_params", UpdateParamsRequest(names))
    following = server.process.call("/cf1/arm", SetBoolRequest(True))
    try:
        text = "'effect' is no .*; the ROS master .*/cf1/ring/effect within 0.1 s: is it frozen.$"
        with pytest.raises(ServiceError, match=text):
            update.result(10.0)
        assert following.result(10.0).success
    finally:
        answers.set()
