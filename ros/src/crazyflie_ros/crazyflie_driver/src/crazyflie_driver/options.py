"""What is asked of the server when a vehicle is added."""

import math
from dataclasses import dataclass

import rosgraph.names

from crazyflie_utils import ServiceError

STANDARD_TOPICS = (
    "imu",
    "temperature",
    "magnetic_field",
    "pressure",
    "battery",
    "pose",
    "packets",
)
"""Topics that are switched by ``enable_logging_NAME``."""


@dataclass(frozen=True)
class CustomBlock:
    """A custom log block.

    Attributes
    ----------
    topic : str
        Below the vehicle's prefix.
    period_ms : int
    variables : tuple of str
    """

    topic: str
    period_ms: int
    variables: tuple


@dataclass(frozen=True)
class VehicleOptions:
    """How a vehicle is to be connected.

    Attributes
    ----------
    uri : str
    prefix : str
        Absolute namespace of the vehicle, such as /crazyflie1.
    roll_trim, pitch_trim : float
        Added to cmd_vel, degrees.
    use_ros_time : bool
        Whether stamps are ROS time, not the vehicle's own.
    enable_parameters : bool
        Whether the firmware's parameters become ROS parameters.
    topics : frozenset of str
        Which of `STANDARD_TOPICS` are published.
    custom_blocks : tuple of CustomBlock
    """

    uri: str
    prefix: str
    roll_trim: float
    pitch_trim: float
    use_ros_time: bool
    enable_parameters: bool
    topics: frozenset
    custom_blocks: tuple

    @property
    def name(self) -> str:
        """Prefix without the leading slash: part of frame names, for messages."""
        return self.prefix.lstrip("/")

    @classmethod
    def from_request(cls, request) -> "VehicleOptions":
        """Return the options in a crazyflie_driver/AddCrazyflieRequest.

        Raises
        ------
        ServiceError
            One of them makes no sense; the text says which.
        """
        prefix = "/" + request.tf_prefix.strip("/ ")
        if prefix == "/" or not rosgraph.names.is_legal_name(prefix):
            raise ServiceError(
                f"tf_prefix is {request.tf_prefix!r}; expected the name of a namespace, such as "
                "crazyflie1"
            )
        for trim in ("roll_trim", "pitch_trim"):
            if not math.isfinite(getattr(request, trim)):
                raise ServiceError(f"{trim} is {getattr(request, trim)}; expected degrees")
        topics, blocks = frozenset(), ()
        if request.enable_logging:
            topics = frozenset(
                name for name in STANDARD_TOPICS if getattr(request, f"enable_logging_{name}")
            )
            blocks = tuple(map(_custom_block, request.log_blocks))
            _check_names([block.topic for block in blocks])
        return cls(
            request.uri.strip(),
            prefix,
            request.roll_trim,
            request.pitch_trim,
            request.use_ros_time,
            request.enable_parameters,
            topics,
            blocks,
        )


def _custom_block(block):
    return CustomBlock(block.topic_name.strip("/ "), block.frequency, tuple(block.variables))


def _check_names(names):
    for name in names:
        if not name or not rosgraph.names.is_legal_name(name):
            raise ServiceError(f"topic_name of a log block is {name!r}; expected a topic's name")
        if name in STANDARD_TOPICS or name == "rssi":
            raise ServiceError(f"a log block cannot be called {name!r}: the driver has that topic")
        if names.count(name) > 1:
            raise ServiceError(f"two log blocks are called {name!r}")
