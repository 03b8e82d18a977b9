"""Parameters that are written to a vehicle, and again when it may have lost them."""

import threading
from functools import partial
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
        self.kept = {}

    def known(self, name):
        return self.kept.get(name)

    def write(self, name, value):
        if name in self.errors:
            raise self.errors[name]
        self.written.append((name, value))
        self.kept[name] = value
        return value

    def restart(self):
        self.kept.clear()
        self.written.clear()


def make_mirror(values):
    """Return a mirror with these values of ROS parameters, its firmware and its process."""
    process = FakeProcess({f"/cf1/{name}": value for name, value in values.items()})
    firmware = Firmware()
    crazyflie = SimpleNamespace(parameters=firmware)
    return ParameterMirror(process.handle("/server"), "/cf1", crazyflie), firmware, process


def test_what_a_vehicle_has_lost_is_written_again_and_nothing_else():
    mirror, firmware, process = make_mirror({"ring/effect": 7, "motor/trim": 1})
    assert mirror.lost() == {}
    mirror.write(["ring/effect", "motor/trim"])
    assert mirror.lost() == {}
    firmware.restart()
    firmware.kept["motor.trim"] = 1
    # Values that were set since, but not written, are ignored.
    process.transport.set_param("/cf1/ring/effect", 8)
    assert mirror.lost() == {"ring.effect": 7}
    mirror.reapply(mirror.lost())
    assert firmware.written == [("ring.effect", 7)]


TRIGGERS = (
    *("health/startPropTest", "health/startBatTest", "health/propTestPWMRatio"),
    *("motorPowerSet/enable", "motorPowerSet/m1", "system/arm", "system/doAssert"),
    *("system/storageReformat", "stabilizer/stop", "kalman/resetEstimation", "ctrlMel/resetI"),
    *("lighthouse/bsCalibReset", "memTst/resetW", "flightmode/yawRst", "supervisor/infdmp"),
)


@pytest.mark.parametrize("name", TRIGGERS)
def test_what_has_the_vehicle_act_is_not_written_again(name):
    mirror, firmware, _ = make_mirror({name: 1})
    mirror.write([name])
    firmware.restart()
    assert mirror.lost() == {}
    mirror.reapply(mirror.lost())
    assert firmware.written == []


START = {"kalman/initialX": 1.5, "kalman/initialYaw": 0.5}


@pytest.mark.parametrize("kept", [{}, {"kalman.initialYaw": 0.5}])
def test_an_estimate_that_has_begun_elsewhere_is_reset_at_its_initial_position(kept):
    mirror, firmware, _ = make_mirror({**START, "ring/effect": 7, "kalman/resetEstimation": 1})
    mirror.write([*START, "kalman/resetEstimation", "ring/effect"])
    firmware.restart()
    firmware.kept.update(kept)
    mirror.reapply(mirror.lost())
    assert firmware.written[0] == ("kalman.initialX", 1.5)
    assert firmware.written[-1] == ("kalman.resetEstimation", 1)


def test_an_estimate_is_not_reset_without_cause():
    """It has begun where it is; or a reset was never asked for; or the place is not written."""
    mirror, firmware, _ = make_mirror({**START, "ring/effect": 7, "kalman/resetEstimation": 1})
    mirror.write([*START, "ring/effect"])
    firmware.restart()
    mirror.reapply(mirror.lost())
    assert len(firmware.written) == 3
    mirror.write(["kalman/resetEstimation"])
    firmware.restart()
    firmware.kept.update({"kalman.initialX": 1.5, "kalman.initialYaw": 0.5})
    mirror.reapply(mirror.lost())
    assert firmware.written == [("ring.effect", 7)]
    firmware.restart()
    firmware.errors["kalman.initialX"] = NoReplyError("none")
    assert mirror.reapply(mirror.lost()) == ["none"]
    assert ("kalman.resetEstimation", 1) not in firmware.written


@pytest.fixture
def mirror():
    """Return a mirror that has written three parameters, and the firmware."""
    names = ["ring/effect", "motor/trim", "sound/freq"]
    mirror, firmware, _ = make_mirror(dict.fromkeys(names, 7))
    mirror.write(names)
    firmware.restart()
    return mirror, firmware


@pytest.mark.parametrize("error", [RefusedError("writing ring.effect: no"), NoReplyError("none")])
def test_one_that_cannot_be_written_again_does_not_stop_the_others(mirror, error):
    mirror, firmware = mirror
    firmware.errors["ring.effect"] = error
    assert mirror.reapply(mirror.lost()) == [str(error)]
    assert firmware.written == [("motor.trim", 7), ("sound.freq", 7)]


def test_a_link_that_is_lost_meanwhile_stops_them(mirror):
    mirror, firmware = mirror
    firmware.errors["motor.trim"] = LinkLostError("gone")
    with pytest.raises(LinkLostError):
        mirror.reapply(mirror.lost())


def test_a_master_that_is_frozen_does_not_block_the_jobs_of_a_vehicle(server, vehicle, monkeypatch):
    """It accepts connections, and never answers."""
    answers = threading.Event()
    transport = server.process.transport
    ask = partial(transport.outside, answers.wait, 20.0)
    monkeypatch.setattr(transport, "get_param", lambda name: ask())
    monkeypatch.setattr("crazyflie_driver.services.MASTER_LIMIT", 0.1)
    names = ["effect", "ring/effect", "ring/neopixel"]
    update = server.process.call("/cf1/update_params", UpdateParamsRequest(names))
    following = server.process.call("/cf1/arm", SetBoolRequest(True))
    try:
        text = "'effect' is not .*; the ROS master .*/cf1/ring/effect within 0.1 s: is it frozen.$"
        with pytest.raises(ServiceError, match=text):
            update.result(10.0)
        assert following.result(10.0).success
    finally:
        answers.set()
