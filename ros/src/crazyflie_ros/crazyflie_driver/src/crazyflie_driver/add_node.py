"""A node that has the server add one vehicle, and ends."""

from dataclasses import dataclass

from crazyflie_driver.msg import LogBlock
from crazyflie_driver.options import STANDARD_TOPICS
from crazyflie_driver.server_node import ADD
from crazyflie_driver.srv import AddCrazyflie, AddCrazyflieRequest
from crazyflie_utils import Node, ParameterError
from crazyflie_utils.parameter_types import BOOLEAN, FINITE, TEXT, Integer

_LIMIT = 60.0
"""How long, in s, the server may take to come up and to connect."""

_PERIOD_MS = Integer(10, 2540)


class CrazyflieAddNode(Node):
    """Ask for a vehicle; the process exits with status 1 if that fails."""

    def __init__(self):
        super().__init__()
        self._request = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._request = AddCrazyflieRequest(
            uri=handle.param("uri", TEXT),
            tf_prefix=handle.param("tf_prefix", TEXT),
            roll_trim=handle.param("roll_trim", FINITE, 0.0),
            pitch_trim=handle.param("pitch_trim", FINITE, 0.0),
            enable_logging=handle.param("enable_logging", BOOLEAN, True),
            enable_parameters=handle.param("enable_parameters", BOOLEAN, True),
            use_ros_time=handle.param("use_ros_time", BOOLEAN, True),
            log_blocks=_log_blocks(handle),
        )
        for topic in STANDARD_TOPICS:
            is_wanted = handle.param(f"enable_logging_{topic}", BOOLEAN, topic != "pose")
            setattr(self._request, f"enable_logging_{topic}", is_wanted)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        handle.info(f"adding {self._request.uri} as {self._request.tf_prefix}")
        handle.call_service(ADD, AddCrazyflie, self._request, _LIMIT).add_done_callback(
            self._on_answer
        )

    def _on_answer(self, done):
        error = done.exception()
        if error is None:
            self._handle.info(f"added {self._request.uri} as {self._request.tf_prefix}")
        else:
            self._handle.error(f"cannot add {self._request.uri}: {error}")
        self._handle.end(0 if error is None else 1)


@dataclass(frozen=True)
class _ListOf:
    """A list, of which every entry is of a kind."""

    kind: object

    def __call__(self, value) -> list:
        if not isinstance(value, list):
            raise ValueError
        return [self.kind(entry) for entry in value]

    def __str__(self) -> str:
        return f"a list, each entry {self.kind}"


def _log_blocks(handle):
    topics = handle.param("genericLogTopics", _ListOf(TEXT), [])
    periods = handle.param("genericLogTopicFrequencies", _ListOf(_PERIOD_MS), [])
    if len(topics) != len(periods):
        raise ParameterError(
            f"parameter {handle.resolve('~genericLogTopicFrequencies')} has {len(periods)} "
            f"entries, genericLogTopics {len(topics)}; expected as many (periods in ms)"
        )
    return [
        LogBlock(topic, period, handle.param(f"genericLogTopic_{topic}_Variables", _ListOf(TEXT)))
        for topic, period in zip(topics, periods, strict=True)
    ]
