"""The settings of a virtual vehicle, ROS parameters or a command line, and its faults."""

from types import SimpleNamespace

from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import BOOLEAN, METRES, SHARE, TEXT, Integer, Number, Text
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL


def switches(settings: Parameters) -> SimpleNamespace:
    """Return the values of the live settings, which may be changed at any time.

    The value of ``fault/silence`` is the remaining time.
    """
    names = (each.name.removeprefix("fault/") for each in settings.declarations() if each.live)
    return SimpleNamespace(**{name: getattr(settings, name) for name in names})


#: Positioning systems of a vehicle: decks that know the true pose, real decks, and none.
DECK, FLOW, LIGHTHOUSE, LOCO, NONE = "deck", "flow", "lighthouse", "loco", "none"

MOST_STATIONS = 16  #: Largest number of base stations of the firmware.
OBSERVER_PORT = 19800  #: UDP port to which the true pose is sent.
FIRST_PORT = 19850  #: UDP port of the first vehicle: clients scan from here to 19859.

_FRACTION = Number(minimum=-0.5, maximum=1.0)
UDP_PORT = Integer(0, 65535)  #: Of a server that may choose it, or of none.


class VehicleSettings(Parameters):
    """Settings of a virtual vehicle; the live ones are its faults, see `switches`."""

    host: str = parameter(TEXT, "address on which the vehicle listens", "127.0.0.1")
    port: int = parameter(UDP_PORT, "UDP port; 0 selects a free one, which is printed", FIRST_PORT)
    init_x: float = parameter(METRES, "initial position", 0.0, "init/x")
    init_y: float = parameter(METRES, "initial position", 0.0, "init/y")
    init_yaw: float = parameter(Number("rad"), "initial heading", 0.0, "init/yaw")
    positioning: str = parameter(
        Text((DECK, FLOW, LIGHTHOUSE, LOCO, NONE)),
        "source of the estimate without external poses: the true pose (`deck`), a Flow deck, which "
        "drifts, a Lighthouse or a Loco deck, or the inertial sensors only (`none`)",
        DECK,
    )
    estimator: int = parameter(
        Integer(1, 2),
        "stabilizer.estimator at the start: 2 is the Kalman filter, 1 the complementary one, with "
        "which a vehicle without decks begins and which ignores external poses",
        2,
    )
    smooth_x: float = parameter(METRES, "middle of the patch of `fault/smooth`", 0.0, "smooth/x")
    smooth_y: float = parameter(METRES, "the same", 0.0, "smooth/y")
    base_stations: int = parameter(
        Integer(1, MOST_STATIONS),
        "of Lighthouse; with more than 4, a firmware with room for that many",
        2,
    )
    knows_stations: bool = parameter(
        BOOLEAN, "store the geometry of the base stations on the vehicle", True
    )
    multiranger: bool = parameter(
        BOOLEAN,
        "carry a Multi-ranger deck, which sees the ground and the objects of `world`",
        False,
    )
    color_leds: bool = parameter(
        BOOLEAN, "carry Color LED decks below and on top, in place of the LED ring", False
    )
    world: str = parameter(
        Text(may_be_empty=True),
        "world file of crazyflie_world for ranging sensors; empty for the ground alone",
        "",
    )
    auto_arm: bool = parameter(
        BOOLEAN,
        "arm automatically, like a Crazyflie 2.1; otherwise the client arms, as with brushless "
        "motors",
        True,
    )
    sensor_noise: bool = parameter(BOOLEAN, "noise of gyroscope, accelerometer and barometer", True)
    seed: int = parameter(Integer(0, 2**31 - 1), "seed of the noise and of the packet loss", 0)
    model: str = parameter(
        VEHICLE_MODEL,
        "type of the vehicle, or model file; with `lag/roll`, its lags replace the attitude loops",
        "cf21",
    )
    mass_error: float = parameter(
        _FRACTION, "how much heavier than nominal the vehicle is, as a fraction", 0.0
    )
    thrust_error: float = parameter(
        _FRACTION, "how much more than nominal its rotors lift, as a fraction", 0.0
    )
    ground_effect: bool = parameter(BOOLEAN, "whether the rotors lift more near the ground", False)
    battery: float = parameter(SHARE, "state of charge at the beginning", 1.0)
    protocol: int = parameter(
        Integer(11, 12),
        "CRTP protocol version; 11 has no supervisor port (9), and no flags of the high-level "
        "commander in supervisor.info",
        12,
    )
    address: int = parameter(Integer(0, 255), "last byte of the radio's address, E7E7E7E7xx", 0xE7)
    observer_host: str = parameter(
        TEXT, "host to which the true pose is sent", "127.0.0.1", "observer/host"
    )
    observer_port: int = parameter(
        UDP_PORT, "UDP port on that host; 0 sends nothing", OBSERVER_PORT, "observer/port"
    )
    observer_rate: float = parameter(
        Number("Hz", minimum=1.0, maximum=500.0), "how often", 200.0, "observer/rate"
    )
    body_name: str = parameter(
        Text(may_be_empty=True),
        "name of the rigid body there; empty for a name by port: cf1 for 19850, and so on",
        "",
        "observer/name",
    )
    body_id: int = parameter(
        Integer(0, 32767),
        "number of the rigid body there; 0 for a number by port: 1 for 19850, and so on",
        0,
        "observer/id",
    )
    loss: float = parameter(
        SHARE,
        "probability that a packet is lost, in either direction",
        0.0,
        "fault/loss",
        live=True,
    )
    delay: float = parameter(
        Number("s", minimum=0.0, maximum=10.0),
        "delay of each packet, in each direction",
        0.0,
        "fault/delay",
        live=True,
    )
    silence: float = parameter(
        Number("s", minimum=0.0),
        "time for which the link is silent from now on; the port stays open, the vehicle flies on",
        0.0,
        "fault/silence",
        live=True,
    )
    low_battery: bool = parameter(
        BOOLEAN,
        "the battery is nearly empty from now on; cannot be undone",
        False,
        "fault/low_battery",
        live=True,
    )
    motor_failure: int = parameter(
        Integer(0, 4), "the failed motor, 1 to 4; 0 for none", 0, "fault/motor_failure", live=True
    )
    deck: bool = parameter(
        BOOLEAN, "a deck reports a fault of its hardware: no flight", False, "fault/deck", live=True
    )
    occluded: int = parameter(
        Integer(0, (1 << MOST_STATIONS) - 1),
        "base stations that the Lighthouse deck does not see, as a sum: 1 the first, 2 the second, "
        "4 the third, and so on",
        0,
        "fault/occluded",
        live=True,
    )
    smooth: float = parameter(
        Number("m", minimum=0.0),
        "radius of a patch of floor without texture: no optical flow there",
        0.0,
        "fault/smooth",
        live=True,
    )
