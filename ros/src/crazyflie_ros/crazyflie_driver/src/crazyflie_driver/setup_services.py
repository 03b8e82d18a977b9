"""Services that set a vehicle up, or up again after a crash."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from std_srvs.srv import Empty, EmptyResponse

from crazyflie_driver import srv
from crazyflie_driver.emergency import Emergency
from crazyflie_driver.flight_state import FlightState
from crazyflie_driver.jobs import Job, Jobs
from crazyflie_driver.parameter_mirror import ParameterMirror, parsed_name
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import ParameterError, ServiceError

_SOLID_COLOR = 7  #: The firmware's ring.effect for a color of its own.


@dataclass(eq=False)
class SetupServices:
    """Recovery, LED ring, stored parameters, base stations; each is a job of the vehicle."""

    _crazyflie: Crazyflie
    _jobs: Jobs
    _flight: FlightState
    _emergency: Emergency
    _mirror: ParameterMirror

    def services(self) -> dict[str, tuple[type, Callable[[Any], Any]]]:
        """Return name -> (type, callback)."""
        return {
            "recover": (Empty, self._job("recovery", self._recover)),
            "set_led_color": (srv.SetLedColor, self._job("set_led_color", self._set_led_color)),
            "store_params": (srv.UpdateParams, self._job("store_params", self._store)),
            "clear_params": (srv.UpdateParams, self._job("clear_params", self._clear)),
            "param_state": (srv.ParamState, self._job("param_state", self._state)),
            "write_lighthouse": (
                srv.WriteLighthouse,
                self._job("write_lighthouse", self._write_lighthouse),
            ),
        }

    def _job(self, name: str, work: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def callback(request):
            def run(_: Job) -> Any:
                try:
                    return work(request)
                except ParameterError as error:
                    raise ServiceError(str(error)) from None

            return self._jobs.submit(name, run)

        return callback

    def _recover(self, _):
        self._emergency.refuse()
        self._crazyflie.supervisor.recover()
        return EmptyResponse()

    def _set_led_color(self, request):
        color = request.color
        parts = {"Red": color.r, "Green": color.g, "Blue": color.b}
        for name, value in parts.items():
            # One that is not a number is refused as well.
            if not 0.0 <= value <= 1.0:
                raise ServiceError(f"color: {name.lower()} is {value:g}; expected 0 to 1")
        for name, value in parts.items():
            self._mirror.set(f"ring.solid{name}", round(255 * value))
        self._mirror.set("ring.effect", _SOLID_COLOR)
        return srv.SetLedColorResponse()

    def _store(self, request):
        for name in map(parsed_name, request.params):
            self._crazyflie.parameters.store(name)
        return srv.UpdateParamsResponse()

    def _clear(self, request):
        for name in map(parsed_name, request.params):
            self._crazyflie.parameters.clear(name)
        return srv.UpdateParamsResponse()

    def _state(self, request):
        state = self._crazyflie.parameters.stored(parsed_name(request.param))
        stored = math.nan if state.stored_value is None else state.stored_value
        return srv.ParamStateResponse(state.is_stored, state.default_value, stored)

    def _write_lighthouse(self, request):
        state = self._flight.read()
        if state is None or SupervisorState.FLYING in state:
            words = "unknown" if state is None else state.words()
            raise ServiceError(
                "write_lighthouse moves the vehicle's estimate: expected it on the ground (2 s "
                f"after a landing); its state is: {words}"
            )
        self._crazyflie.lighthouse.write_file(request.file, self._crazyflie.parameters)
        return srv.WriteLighthouseResponse()
