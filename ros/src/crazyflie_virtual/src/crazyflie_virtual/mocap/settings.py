"""The settings of the virtual motion capture system: ROS parameters, or a command line."""

from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import BOOLEAN, TEXT, Integer, Number, Text
from crazyflie_virtual.mocap.natnet import VERSIONS
from crazyflie_virtual.mocap.scene import OCCLUSION, MocapSwitches
from crazyflie_virtual.observer import DEFAULT_PORT


class MocapSettings(Parameters):
    """Settings of the NatNet server; the live ones are its `MocapSwitches`."""

    host: str = parameter(
        TEXT, "address to listen on, and of the interface for multicast", "127.0.0.1"
    )
    command_port: int = parameter(
        Integer(0, 65535), "UDP port for commands; 0 takes a free one", 1510
    )
    data_port: int = parameter(Integer(1, 65535), "UDP port of the multicast stream", 1511)
    multicast: bool = parameter(
        BOOLEAN, "stream to the group, not to each client that sends keep-alives", False
    )
    multicast_address: str = parameter(TEXT, "the group, an IPv4 address", "239.255.42.99")
    version: str = parameter(
        Text(VERSIONS), "NatNet version of the stream (quote it in YAML)", "3.1"
    )
    rate: float = parameter(Number("Hz", minimum=1.0, maximum=1000.0), "frames per second", 120.0)
    observer_port: int = parameter(
        Integer(0, 65535),
        "UDP port at which the vehicles' true poses arrive; 0 takes a free one",
        DEFAULT_PORT,
        "observer/port",
    )
    position_noise: float = parameter(
        Number("m", minimum=0.0), "standard deviation along each axis", 0.0, "noise/position"
    )
    attitude_noise: float = parameter(
        Number("rad", minimum=0.0),
        "standard deviation about each axis of the body",
        0.0,
        "noise/attitude",
    )
    latency: float = parameter(
        Number("s", minimum=0.0, maximum=1.0), "from exposure to dispatch", 0.0
    )
    seed: int = parameter(Integer(0, 2**31 - 1), "of the noise", 0)
    dropout: float = parameter(
        Number(minimum=0.0, maximum=1.0),
        "probability with which a body is not tracked in a frame",
        0.0,
        "fault/dropout",
        live=True,
    )
    invalid: str = parameter(
        Text(may_be_empty=True),
        "bodies that are not tracked: numbers with commas, or all",
        "",
        "fault/invalid",
        live=True,
    )
    silent: bool = parameter(BOOLEAN, "no frames are sent", False, "fault/silent", live=True)
    ghosts: float = parameter(
        Number(minimum=0.0, maximum=100.0),
        "mean number of reflections in a frame, markers of no vehicle",
        0.0,
        "fault/ghosts",
        live=True,
    )
    occlusions: float = parameter(
        Number("1/s", minimum=0.0, maximum=100.0),
        f"how often each vehicle begins to be hidden, for up to {OCCLUSION:g} s",
        0.0,
        "fault/occlusions",
        live=True,
    )
    single_markers: str = parameter(
        Text(may_be_empty=True),
        "vehicles that have one marker and are no rigid bodies: numbers with commas, or all",
        "",
    )

    def switches(self) -> MocapSwitches:
        """Return the switches as they are at the beginning."""
        return MocapSwitches(self.dropout, self.invalid, self.silent, self.ghosts, self.occlusions)
