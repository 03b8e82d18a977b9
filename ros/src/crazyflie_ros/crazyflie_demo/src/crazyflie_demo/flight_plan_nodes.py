"""ROS interfaces of flights by high-level commands: there and back, and along a trajectory."""

from concurrent.futures import Future
from typing import Any

from genpy import Duration
from geometry_msgs.msg import Point
from typing_extensions import TypeVar, override

from crazyflie_demo.trajectory_file import load, summary
from crazyflie_driver import srv
from crazyflie_driver.trajectory_messages import to_message
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_utils import Node, NodeHandle, Parameters, ServiceError, parameter
from crazyflie_utils.parameters.types import BOOLEAN, METRES, Number, path_of
from crazyflie_utils.steps import Steps, follow

#: Timeout of a service call, of the driver's connection before the first one, and of the master's
#: answer (s).
_LIMIT = 15.0

_PAUSE = 0.5  #: Pause between two manoeuvres (s).

#: Duration of a landing over that of a takeoff. At its end the firmware stops the motors, and the
#: vehicle, which lags behind the setpoint, is still in the air: from 0.5 m, the virtual one falls
#: the last 6 cm of a landing of 2 s and touches down with 0.8 m/s; in one of 3 s, with 0.1 m/s.
_LANDING = 1.5

_HIGH_LEVEL = "commander/enHighLevel"


class FlightPlanParameters(Parameters):
    """Parameters that all flights by high-level commands have."""

    height: float = parameter(Number("m", above=0.0, maximum=3.0), "height of the takeoff", 0.5)
    duration: float = parameter(
        Number("s", above=0.0, maximum=60.0),
        "duration of the takeoff and of each go-to; the landing takes 1.5 times as long",
        2.0,
    )


P = TypeVar("P", bound=FlightPlanParameters, default=Any)


class FlightPlanNode(Node[P]):
    """Take off, make the calls of a subclass, land; then end the process.

    If a call fails, and when the process is ended in flight, the vehicle is landed.
    """

    def __init__(self) -> None:
        self._is_flying = False

    def manoeuvres(self) -> Steps[None]:
        """Yield the calls between takeoff and landing; see `call`."""
        raise NotImplementedError

    def preparations(self) -> Steps[None]:
        """Yield the calls before the takeoff."""
        yield from ()

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        follow(self._calls(), handle.submit).add_done_callback(self._end)

    def _calls(self):
        height, duration = self._parameters.height, self._parameters.duration
        # Answered when the driver has connected and read all parameters of the vehicle, which
        # overwrites earlier values.
        yield from self.call("update_params", srv.UpdateParams)
        yield self._enable()
        yield from self.call("update_params", srv.UpdateParams, params=[_HIGH_LEVEL])
        yield from self.preparations()
        length = Duration.from_sec(duration)
        yield from self.call("takeoff", srv.Takeoff, duration, height=height, duration=length)
        yield from self.manoeuvres()
        yield from self._land()
        yield from self.call("stop", srv.Stop)

    def _land(self):
        duration = _LANDING * self._parameters.duration
        length = Duration.from_sec(duration)
        return self.call("land", srv.Land, duration, height=0.0, duration=length)

    @override
    def enter_safe_state(self) -> None:
        if self._is_flying:
            self._is_flying = False
            self._handle.warn("landing")
            next(self._land())

    def call(
        self, service: str, service_type: Any, length: float = 0.0, **request: Any
    ) -> Steps[None]:
        """Yield the call of a service in the node's namespace, and the wait for its manoeuvre.

        The manoeuvre takes ``length`` (s); ``request`` are the fields of the request.
        """
        handle = self._handle
        self._error = f"{handle.resolve(service)} failed:"
        handle.info(f"{service}, {length:g} s")
        # A takeoff may have started although its call fails.
        self._is_flying |= service == "takeoff"
        message = service_type._request_class(**request)
        yield handle.call_service(service, service_type, message, _LIMIT)
        self._is_flying &= service != "land"
        if length > 0.0:
            yield self._done_within(length + _PAUSE)

    def _enable(self):
        self._error = f"parameter {self._handle.resolve(_HIGH_LEVEL)} is not set"
        done = self._done_within(_LIMIT, ServiceError(f"within {_LIMIT:g} s"))
        # The master may be slow, or frozen.
        is_set = self._handle.set_param_later(_HIGH_LEVEL, 1)
        is_set.add_done_callback(lambda _: self._handle.submit(_settle, done, is_set.exception()))
        return done

    def _done_within(self, limit, error=None):
        """Return a future that ends after a time (s), with an error if there is one."""
        done: Future[None] = Future()
        timer = self._handle.timer(limit, lambda: _settle(done, error))
        done.add_done_callback(lambda _: timer.stop())
        return done

    def _end(self, done):
        error = done.exception()
        if error is None:
            self._handle.info("done")
        else:
            self._handle.error(f"{self._error} {error}")
        self._handle.end(0 if error is None else 1)


def _settle(done, error):
    if not done.done():
        done.set_exception(error) if error else done.set_result(None)


class HighLevelFlightParameters(FlightPlanParameters):
    """Parameters of `HighLevelFlightNode`."""

    distance: float = parameter(METRES, "distance that the vehicle flies ahead", 0.5)


class HighLevelFlightNode(FlightPlanNode[HighLevelFlightParameters]):
    """Take off, fly ahead and back, land."""

    @override
    def manoeuvres(self) -> Steps[None]:
        duration = self._parameters.duration
        for x in (self._parameters.distance, -self._parameters.distance):
            yield from self.call(
                "go_to",
                srv.GoTo,
                duration,
                relative=True,
                goal=Point(x, 0.0, 0.0),
                duration=Duration.from_sec(duration),
            )


class TrajectoryFlightParameters(FlightPlanParameters):
    """Parameters of `TrajectoryFlightNode`."""

    pieces: list[PolynomialPiece] = parameter(
        path_of(load, "a CSV file with a trajectory"), "CSV file of the trajectory", name="file"
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
    def preparations(self) -> Steps[None]:
        pieces = [to_message(piece) for piece in self._parameters.pieces]
        return self.call("upload_trajectory", srv.UploadTrajectory, pieces=pieces)

    @override
    def manoeuvres(self) -> Steps[None]:
        parameters = self._parameters
        return self.call(
            "start_trajectory",
            srv.StartTrajectory,
            summary(parameters.pieces).duration * parameters.timescale,
            timescale=parameters.timescale,
            reversed=parameters.reversed,
            relative=True,
        )
