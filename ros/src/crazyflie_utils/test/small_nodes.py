"""Small nodes for the rostests; run this file with a class's name to run one."""

import json
import sys
import threading

from std_msgs.msg import Float64, Int64
from std_srvs.srv import Trigger, TriggerResponse

from crazyflie_utils import Node, Parameters, ServiceError, parameter, run
from crazyflie_utils.parameters.types import TIME_STEP, TOPIC, Integer

SAFE = -1.0
"""The last message of a `Ticker`."""


class RelayParameters(Parameters):
    """Parameters of a `Relay`."""

    offset: int = parameter(Integer(0, 10**9), "added to every number", live=True)
    in_topic: str = parameter(TOPIC, "where numbers come from", name="topics/in")
    out_topic: str = parameter(TOPIC, "where they go", name="topics/out")


class Relay(Node):
    """Passes on every number, increased by ~offset."""

    def load_parameters(self, handle):
        self._parameters = handle.load(RelayParameters, self._reconfigure)

    def register_callbacks(self, handle):
        self._publisher = handle.publisher(self._parameters.out_topic, Int64)
        handle.subscribe(self._parameters.in_topic, Int64, self._on_number)

    def _reconfigure(self, parameters):
        self._parameters = parameters

    def _on_number(self, message):
        self._publisher.publish(Int64(message.data + self._parameters.offset))


class Flown(Node):
    """Has its vehicle be the only one that flies by a topic."""

    def load_parameters(self, handle):
        self._topic = handle.get_param("~topics/control", TOPIC)

    def register_callbacks(self, handle):
        handle.claim_controls(self._topic, "simulated")


class Ledger(Node):
    """Writes down every number; ~report tells them."""

    def load_parameters(self, handle):
        self._topic = handle.get_param("~topics/in", TOPIC)

    def register_callbacks(self, handle):
        self._numbers = []
        handle.advertise_service("~report", Trigger, self._report)
        handle.advertise_service("~refuse", Trigger, self._refuse)
        handle.advertise_service("~add", Trigger, self._add)
        handle.subscribe(self._topic, Int64, lambda message: self._numbers.append(message.data))

    def _report(self, request):
        return TriggerResponse(True, json.dumps(self._numbers))

    def _refuse(self, request):
        raise ServiceError("the ledger is closed")

    def _add(self, request):
        self._numbers.append(1)
        return TriggerResponse(True, "")


class Herald(Node):
    """Says 42 once, latched."""

    def load_parameters(self, handle):
        self._topic = handle.get_param("~topics/out", TOPIC)

    def register_callbacks(self, handle):
        handle.publisher(self._topic, Int64, latch=True).publish(Int64(42))


class Ticker(Node):
    """Tells the time every ~time_step."""

    def load_parameters(self, handle):
        self._time_step = handle.get_param("~time_step", TIME_STEP)

    def register_callbacks(self, handle):
        self._publisher = handle.publisher("~time", Float64)
        handle.timer(self._time_step, self._on_timer)

    def _on_timer(self):
        self._publisher.publish(Float64(self._handle.time()))

    def enter_safe_state(self):
        self._publisher.publish(Float64(SAFE))


class Pilot(Ticker):
    """A ticker in flight, which lands at ~land only; ~time_step is that of the ticks."""

    needed_in_flight = True

    def register_callbacks(self, handle):
        self._tell = handle.inhibit_shutdown()
        self._tell(True)
        super().register_callbacks(handle)
        handle.advertise_service("~land", Trigger, self._land)

    def prepare_shutdown(self):
        self._handle.info("asked to land")

    def _land(self, request):
        self._tell(False)
        return TriggerResponse(True, "")


class Instrument(Ticker):
    """A ticker that pilots need."""

    needed_in_flight = True


class Clockwork(Node):
    """Moves simulated time by 10 ms every millisecond."""

    def load_parameters(self, handle):
        self._steps = 0

    def register_callbacks(self, handle):
        self._set_clock = handle.clock_publisher()
        handle.timer(0.001, self._on_timer, steady=True)

    def _on_timer(self):
        self._steps += 1
        self._set_clock(self._steps * 0.01)


class Quitter(Ticker):
    """A ticker that ends its process with status 3."""

    def _on_timer(self):
        self._handle.end(3)


class Stuck(Ticker):
    """A ticker whose first tick never returns."""

    def _on_timer(self):
        self._handle.info("stuck from now on")
        threading.Event().wait()


class Broken(Node):
    """A node that cannot even be made."""

    def __init__(self):
        raise RuntimeError("broken by design")


if __name__ == "__main__":
    run(globals()[sys.argv[1]], "small_node")
