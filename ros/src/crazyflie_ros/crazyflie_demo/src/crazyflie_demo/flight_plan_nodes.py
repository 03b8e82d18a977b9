"""ROS interfaces of flights by high-level commands: there and back, and along a trajectory."""

from collections import deque
from typing import Any, NamedTuple

import genpy
from geometry_msgs.msg import Point
from typing_extensions import TypeVar, override

from crazyflie_demo.trajectory_file import load, summary
from crazyflie_driver import srv
from crazyflie_driver.msg import TrajectoryPolynomialPiece
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.server import ParameterWriter
from crazyflie_utils.parameters.types import BOOLEAN, METRES, File, Number

#: Timeout of a service call, of the driver's connection before the first one, and of the master's
#: answer (s).
_LIMIT = 15.0

_PAUSE = 0.5  #: Pause between two manoeuvres (s).

#: Duration of a landing over that of a takeoff. At its end the firmware stops the motors, and the
#: vehicle, which lags behind the setpoint, is still in the air: from 0.5 m, the virtual one falls
#: the last 6 cm of a landing of 2 s and touches down with 0.8 m/s; in one of 3 s, with 0.1 m/s.
_LANDING = 1.5

_HIGH_LEVEL = "commander/enHighLevel"


class Step(NamedTuple):
    """A call of a service in the node's namespace.

    It starts a manoeuvre of a duration (s). The parameter (name in the node's namespace, value) is
    set before the call.
    """

    service: str
    service_type: type
    request: genpy.Message
    duration: float = 0.0
    parameter: tuple[str, int] | None = None


class FlightPlanParameters(Parameters):
    """Parameters that all flights by high-level commands have."""

    height: float = parameter(Number("m", above=0.0, maximum=3.0), "height of the takeoff", 0.5)
    duration: float = parameter(
        Number("s", above=0.0, maximum=60.0),
        "duration of the takeoff and of each go-to; the landing takes 1.5 times as long",
        2.0,
    )

    @property
    def landing_duration(self) -> float:
        """Duration of the landing, s."""
        return _LANDING * self.duration


P = TypeVar("P", bound=FlightPlanParameters, default=Any)


class FlightPlanNode(Node[P]):
    """Take off, carry out the steps of a subclass, land; then end the process.

    If a step fails, and when the process is ended in flight, the vehicle is landed.
    """

    def __init__(self) -> None:
        self._is_flying = False

    def manoeuvres(self) -> list[Step]:
        """Return the steps between takeoff and landing."""
        raise NotImplementedError

    def preparations(self) -> list[Step]:
        """Return the steps before the takeoff."""
        return []

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        height, duration = self._parameters.height, self._parameters.duration
        enable = srv.UpdateParamsRequest([_HIGH_LEVEL])
        takeoff = srv.TakeoffRequest(height=height, duration=seconds(duration))
        self._steps = deque(
            [
                # Answered when the driver has connected and read all parameters of the vehicle,
                # which overwrites earlier values.
                Step("update_params", srv.UpdateParams, srv.UpdateParamsRequest()),
                Step("update_params", srv.UpdateParams, enable, parameter=(_HIGH_LEVEL, 1)),
                *self.preparations(),
                Step("takeoff", srv.Takeoff, takeoff, duration),
                *self.manoeuvres(),
                Step("land", srv.Land, self._landing(), self._parameters.landing_duration),
                Step("stop", srv.Stop, srv.StopRequest()),
            ]
        )
        self._writer = ParameterWriter(self._write, lambda text: handle.submit(self._end, text))
        self._next()

    @override
    def enter_safe_state(self) -> None:
        if self._is_flying:
            self._is_flying = False
            self._handle.warn("landing")
            self._handle.call_service("land", srv.Land, self._landing(), _LIMIT)

    def _landing(self):
        return srv.LandRequest(height=0.0, duration=seconds(self._parameters.landing_duration))

    def _next(self):
        step = self._steps[0]
        self._handle.info(f"{step.service}, {step.duration:g} s")
        if step.parameter is None:
            self._call(step)
            return
        name, value = step.parameter
        error = f"parameter {self._handle.resolve(name)} is not set within {_LIMIT:g} s"
        self._timer = self._handle.timer(_LIMIT, lambda: self._end(error))
        self._writer.set(name, value)

    def _write(self, name, value):
        # In the writer's thread: the master may be slow.
        self._handle.set_param(name, value)
        self._handle.submit(self._on_parameter_set)

    def _on_parameter_set(self):
        # After the limit no further steps are taken.
        if self._steps:
            self._timer.stop()
            self._call(self._steps[0])

    def _call(self, step):
        # A takeoff may have started although its call fails.
        self._is_flying |= step.service == "takeoff"
        answer = self._handle.call_service(step.service, step.service_type, step.request, _LIMIT)
        answer.add_done_callback(self._on_answer)

    def _on_answer(self, done):
        step = self._steps.popleft()
        error = done.exception()
        if error is not None:
            self._end(f"{self._handle.resolve(step.service)} failed: {error}")
            return
        if step.service == "land":
            self._is_flying = False
        if not self._steps:
            self._end()
        elif step.duration > 0.0:
            self._timer = self._handle.timer(step.duration + _PAUSE, self._on_pause)
        else:
            self._next()

    def _on_pause(self):
        self._timer.stop()
        self._next()

    def _end(self, error=""):
        self._steps.clear()
        if error:
            self._handle.error(error)
        else:
            self._handle.info("done")
        self._handle.end(1 if error else 0)


def seconds(duration: float) -> genpy.Duration:
    """Return a duration (s) as a message has it."""
    return genpy.Duration.from_sec(duration)


class HighLevelFlightParameters(FlightPlanParameters):
    """Parameters of `HighLevelFlightNode`."""

    distance: float = parameter(METRES, "distance that the vehicle flies ahead", 0.5)


class HighLevelFlightNode(FlightPlanNode[HighLevelFlightParameters]):
    """Take off, fly ahead and back, land."""

    @override
    def manoeuvres(self) -> list[Step]:
        return [self._go(self._parameters.distance), self._go(-self._parameters.distance)]

    def _go(self, x):
        duration = self._parameters.duration
        request = srv.GoToRequest(
            relative=True, goal=Point(x, 0.0, 0.0), duration=seconds(duration)
        )
        return Step("go_to", srv.GoTo, request, duration)


class TrajectoryFlightParameters(FlightPlanParameters):
    """Parameters of `TrajectoryFlightNode`."""

    pieces: list[PolynomialPiece] = parameter(
        File(load, "a CSV file with a trajectory"), "CSV file of the trajectory", name="file"
    )
    timescale: float = parameter(
        Number(above=0.0, maximum=100.0),
        "factor of the duration: 2 takes twice as long as in the file",
        1.0,
    )
    reversed: bool = parameter(BOOLEAN, "fly from the end to the beginning", False)


class TrajectoryFlightNode(FlightPlanNode[TrajectoryFlightParameters]):
    """Take off, fly along the trajectory of a file from that point on, land."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        super().load_parameters(handle)
        asked = summary(self._parameters.pieces)
        scale = self._parameters.timescale
        handle.info(
            f"the trajectory takes {asked.duration * scale:.1f} s, up to "
            f"{asked.speed / scale:.2f} m/s and {asked.acceleration / scale**2:.2f} m/s^2"
        )

    @override
    def preparations(self) -> list[Step]:
        pieces = [
            TrajectoryPolynomialPiece(*piece.axes, seconds(piece.duration))
            for piece in self._parameters.pieces
        ]
        return [
            Step(
                "upload_trajectory",
                srv.UploadTrajectory,
                srv.UploadTrajectoryRequest(pieces=pieces),
            )
        ]

    @override
    def manoeuvres(self) -> list[Step]:
        parameters = self._parameters
        request = srv.StartTrajectoryRequest(
            timescale=parameters.timescale, reversed=parameters.reversed, relative=True
        )
        duration = summary(parameters.pieces).duration * parameters.timescale
        return [Step("start_trajectory", srv.StartTrajectory, request, duration)]
