"""What flights by high-level commands have in common: one service call after the other."""

from collections import deque
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import genpy

from crazyflie_driver.srv import (
    Land,
    LandRequest,
    Stop,
    StopRequest,
    Takeoff,
    TakeoffRequest,
    UpdateParams,
    UpdateParamsRequest,
)
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import Number

_LIMIT = 15.0
"""How long a service may take, and at the beginning the driver to connect, s."""

_PAUSE = 0.5
"""Between the end of one manoeuvre and the next, s."""

_HIGH_LEVEL = "commander/enHighLevel"


class Step(NamedTuple):
    """A service call.

    Attributes
    ----------
    service : str
        In the node's namespace.
    service_type : type
    request : genpy.Message
    duration : float
        How long what it begins takes, s.
    parameters : dict
        Set before the call: name in the node's namespace -> value.
    """

    service: str
    service_type: type
    request: genpy.Message
    duration: float = 0.0
    parameters: Mapping = MappingProxyType({})


class FlightPlanNode(Node):
    """Carry out a plan: takeoff, what a subclass adds, landing; then end the process.

    If a step fails, and when the process is ended in flight, the vehicle is landed.
    """

    def __init__(self):
        super().__init__()
        self._height = None
        self._duration = None
        self._steps = None
        self._timer = None
        self._is_flying = False

    def manoeuvres(self) -> list[Step]:
        """Return what is done between takeoff and landing."""
        raise NotImplementedError

    def preparations(self) -> list[Step]:
        """Return what is done before the takeoff."""
        return []

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._height = handle.param("height", Number("m", above=0.0, maximum=3.0), 0.5)
        self._duration = handle.param("duration", Number("s", above=0.0, maximum=60.0), 2.0)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        enable = UpdateParamsRequest([_HIGH_LEVEL])
        takeoff = TakeoffRequest(height=self._height, duration=seconds(self._duration))
        self._steps = deque(
            [
                # The first call waits for the driver, which sets all parameters when it has
                # connected; before that nothing can be set for it.
                Step("update_params", UpdateParams, UpdateParamsRequest()),
                Step("update_params", UpdateParams, enable, parameters={_HIGH_LEVEL: 1}),
                *self.preparations(),
                Step("takeoff", Takeoff, takeoff, self._duration),
                *self.manoeuvres(),
                Step("land", Land, self._landing(), self._duration),
                Step("stop", Stop, StopRequest()),
            ]
        )
        self._next()

    def make_safe(self) -> None:
        """See `Node.make_safe`."""
        if self._is_flying:
            self._is_flying = False
            self._handle.warn("landing")
            self._handle.call_service("land", Land, self._landing(), _LIMIT)

    def _landing(self):
        return LandRequest(height=0.0, duration=seconds(self._duration))

    def _next(self):
        step = self._steps[0]
        self._handle.info(f"{step.service}, {step.duration:g} s")
        for name, value in step.parameters.items():
            self._handle.set_param(name, value)
        # A takeoff that is not answered may have begun all the same.
        self._is_flying |= step.service == "takeoff"
        answer = self._handle.call_service(step.service, step.service_type, step.request, _LIMIT)
        answer.add_done_callback(self._handle.guard(self._on_answer))

    def _on_answer(self, done):
        step = self._steps.popleft()
        error = done.exception()
        if error is not None:
            self._handle.error(f"{self._handle.resolve(step.service)} failed: {error}")
            self._handle.end(1)
        elif not self._steps:
            self._handle.info("done")
            self._handle.end(0)
        elif step.duration > 0.0:
            self._timer = self._handle.timer(step.duration + _PAUSE, self._on_pause)
        else:
            self._next()
        if error is None and step.service == "land":
            self._is_flying = False

    def _on_pause(self):
        self._timer.stop()
        self._next()


def seconds(duration: float) -> genpy.Duration:
    """Return a duration (s) as a message has it."""
    return genpy.Duration.from_sec(duration)
