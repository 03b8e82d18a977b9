"""Calls takeoff once, so that one launch file is enough for a flight."""

from std_srvs.srv import Empty, EmptyRequest
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import SERVICE

PERIOD = 0.5  #: Between two checks whether the service is offered, s of the machine's clock.
FLIGHT_LIMIT = 120.0  #: The longest that a takeoff may take, s of the machine's clock.


class TakeoffCallerParameters(Parameters):
    """Parameters of `TakeoffCallerNode`."""

    service: str = parameter(SERVICE, "is called once, when it is there", "/takeoff", "srv/takeoff")


class TakeoffCallerNode(Node):
    """Call takeoff once, as soon as the service is offered."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._service = handle.resolve(handle.load(TakeoffCallerParameters).service)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._timer = handle.timer(PERIOD, self._on_timer, steady=True)

    def _on_timer(self):
        if self._service not in self._handle.service_nodes():
            return
        self._timer.stop()
        future = self._handle.call_service(self._service, Empty, EmptyRequest(), FLIGHT_LIMIT)
        future.add_done_callback(self._on_reply)

    def _on_reply(self, reply):
        if reply.exception() is None:
            self._handle.info("the vehicle flies")
        else:
            self._handle.error(str(reply.exception()))
