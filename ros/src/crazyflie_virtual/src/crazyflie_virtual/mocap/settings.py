"""The options of the virtual motion capture system."""

from dataclasses import dataclass

from crazyflie_virtual.mocap.natnet import VERSIONS
from crazyflie_virtual.mocap.scene import Switches
from crazyflie_virtual.observer import DEFAULT_PORT
from crazyflie_virtual.options import option


@dataclass(frozen=True)
class MocapSettings:
    """Options of the NatNet server; see the README for what each means."""

    host: str = option("127.0.0.1", "address to listen on and to stream from")
    command_port: int = option(
        1510, "UDP port for commands; 0 takes a free one", minimum=0, maximum=65535
    )
    data_port: int = option(1511, "UDP port of the multicast stream", minimum=1, maximum=65535)
    multicast: bool = option(False, "stream to a group and not to each client")
    multicast_address: str = option("239.255.42.99", "the group")
    version: str = option("3.1", "NatNet version of the stream", choices=VERSIONS)
    rate: float = option(120.0, "frames per second", minimum=1.0, maximum=1000.0)
    observer_port: int = option(
        DEFAULT_PORT,
        "UDP port at which the vehicles tell their true poses; 0 takes a free one",
        "observer/port",
        minimum=0,
        maximum=65535,
    )
    position_noise: float = option(
        0.0, "standard deviation along each axis, m", "noise/position", minimum=0.0
    )
    attitude_noise: float = option(
        0.0, "standard deviation about each axis, rad", "noise/attitude", minimum=0.0
    )
    latency: float = option(0.0, "from exposure to dispatch, s", minimum=0.0, maximum=1.0)
    seed: int = option(0, "of the noise", minimum=0, maximum=2**31 - 1)
    dropout: float = option(
        0.0,
        "probability with which a body is not tracked in a frame",
        "fault/dropout",
        minimum=0.0,
        maximum=1.0,
    )
    invalid: str = option(
        "", "numbers of bodies that are not tracked, with commas, or all", "fault/invalid"
    )
    silent: bool = option(False, "hold back all frames", "fault/silent")

    def switches(self) -> Switches:
        """Return the switches as they are at the beginning."""
        return Switches(self.dropout, self.invalid, self.silent)
