"""One service that stops the motors of all vehicles."""

from std_msgs.msg import Empty
from std_srvs.srv import Empty as EmptyService
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle, Parameters, ServiceError, parameter, topic
from crazyflie_utils.parameters.types import SERVICE

REPETITIONS = 20  #: Number of messages for each call.
PERIOD = 0.05  #: Period of the messages (s).


class AllEmergencyParameters(Parameters):
    """Parameters of `AllEmergencyNode`."""

    topic: str = topic(
        "all_emergency", "topic that every takeoff control filter reads", "/all/emergency"
    )
    service: str = parameter(SERVICE, "stops all vehicles", "/all/emergency", "srv/all_emergency")


class AllEmergencyNode(Node[AllEmergencyParameters]):
    """Turn a call into messages to all filters, repeated for those that are just starting."""

    def __init__(self) -> None:
        self._left = 0

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(self._parameters.topic, Empty)
        handle.advertise_service(self._parameters.service, EmptyService, self._on_call)
        handle.timer(PERIOD, self._on_timer, steady=True)

    def _on_call(self, _):
        self._left = REPETITIONS
        self._on_timer()
        if not self._publisher.has_subscribers():
            name = self._handle.resolve(self._parameters.topic)
            raise ServiceError(f"no filter listens on {name}: no vehicle has been stopped")

    def _on_timer(self):
        if self._left > 0:
            self._left -= 1
            self._publisher.publish(Empty())
