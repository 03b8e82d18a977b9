"""What was written to a vehicle is written again when it may have forgotten it."""

from types import SimpleNamespace

from crazyflie_driver.parameter_mirror import ParameterMirror
from crazyflie_utils.testing import FakeProcess


class Firmware:
    """Parameters that remember what is written to them."""

    def __init__(self):
        self.written = []

    def write(self, name, value):
        self.written.append((name, value))
        return value


def test_settings_are_written_again_and_commands_are_not():
    process = FakeProcess({"/cf1/ring/effect": 7, "/cf1/kalman/resetEstimation": 1})
    firmware = Firmware()
    crazyflie = SimpleNamespace(parameters=firmware)
    mirror = ParameterMirror(process.handle("/server"), "/cf1", crazyflie)
    mirror.write_again()
    assert firmware.written == []
    mirror.write(["ring/effect", "kalman/resetEstimation"])
    firmware.written.clear()
    # What somebody has set since, but not written, does not count.
    process.transport.set_param("/cf1/ring/effect", 8)
    mirror.write_again()
    assert firmware.written == [("ring.effect", 7)]
