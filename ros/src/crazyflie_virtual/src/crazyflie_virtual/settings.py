"""The options of a virtual vehicle."""

from dataclasses import dataclass

from crazyflie_virtual.faults import Faults
from crazyflie_virtual.firmware.localization import DECK, NONE
from crazyflie_virtual.observer import DEFAULT_PORT
from crazyflie_virtual.options import option

FIRST_PORT = 19850
"""UDP port of the first vehicle: clients scan from here to 19859."""


@dataclass(frozen=True)
class Settings:
    """Options of a virtual vehicle; see the README for what each means."""

    host: str = option("127.0.0.1", "address to listen on")
    port: int = option(
        FIRST_PORT, "UDP port; 0 takes a free one, which is printed", minimum=0, maximum=65535
    )
    init_x: float = option(0.0, "where the vehicle stands at the beginning, m", "init/x")
    init_y: float = option(0.0, "the same, y, m", "init/y")
    init_yaw: float = option(0.0, "heading at the beginning, rad", "init/yaw")
    positioning: str = option(
        DECK,
        "what the vehicle's estimate rests on without external poses: the truth, as from a "
        "positioning deck, or nothing but its inertial sensors",
        choices=(DECK, NONE),
    )
    auto_arm: bool = option(True, "arm by itself, as a Crazyflie 2.1 does")
    sensor_noise: bool = option(True, "noise of the sensors")
    seed: int = option(0, "of noise and of lost packets", minimum=0, maximum=2**31 - 1)
    mass_error: float = option(
        0.0, "how much heavier than nominal, as a fraction", minimum=-0.5, maximum=1.0
    )
    thrust_error: float = option(
        0.0, "how much more thrust than nominal, as a fraction", minimum=-0.5, maximum=1.0
    )
    battery: float = option(1.0, "state of charge at the beginning", minimum=0.0, maximum=1.0)
    protocol: int = option(12, "CRTP version that is reported", minimum=4, maximum=255)
    address: int = option(
        0xE7, "last byte of the radio's address, E7E7E7E7xx", minimum=0, maximum=255
    )
    observer_host: str = option("127.0.0.1", "who is told the true pose", "observer/host")
    observer_port: int = option(
        DEFAULT_PORT, "UDP port there; 0 for nobody", "observer/port", minimum=0, maximum=65535
    )
    observer_rate: float = option(
        200.0, "how often, Hz", "observer/rate", minimum=1.0, maximum=500.0
    )
    body_name: str = option("", "rigid body's name there; empty for cfN", "observer/name")
    body_id: int = option(
        0, "rigid body's number there; 0 for N", "observer/id", minimum=0, maximum=32767
    )
    loss: float = option(
        0.0, "probability that a packet is lost", "fault/loss", minimum=0.0, maximum=1.0
    )
    delay: float = option(
        0.0, "of each packet, each way, s", "fault/delay", minimum=0.0, maximum=10.0
    )
    silence: float = option(
        0.0, "for how long the link is silent from now on, s", "fault/silence", minimum=0.0
    )
    low_battery: bool = option(False, "nearly empty battery", "fault/low_battery")
    motor_failure: int = option(
        0,
        "motor that stands still, 1 to 4; 0 for none",
        "fault/motor_failure",
        minimum=0,
        maximum=4,
    )

    def faults(self) -> Faults:
        """Return the fault switches as they are at the beginning."""
        return Faults(
            self.loss, self.delay, self.silence, int(self.low_battery), self.motor_failure
        )
