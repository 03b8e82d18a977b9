"""ROS interface of a simulated vehicle with motors, inner loops and wind."""

from functools import partial

from typing_extensions import override

from crazyflie_model.aerodynamics import Air, ground_effect
from crazyflie_model.dynamics import Dynamics
from crazyflie_model.first_order_quadrotor import FirstOrderQuadrotor
from crazyflie_model.limits import CRASH_TILT
from crazyflie_model.stabilized_quadrotor import Airframe, StabilizedQuadrotor
from crazyflie_simulator.simulator_node import SimulatorNode, SimulatorParameters
from crazyflie_simulator.wind import Wind
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters import vehicle_model
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import BOOLEAN, Number
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL

_ERROR = Number(minimum=-0.5, maximum=0.5)
_SPEED = Number("m/s", minimum=-100.0, maximum=100.0)


class WindParameters(Parameters):
    """The air around the vehicle."""

    x: float = parameter(_SPEED, "mean wind, fixed frame", 0.0, live=True)
    y: float = parameter(_SPEED, "mean wind, fixed frame", 0.0, live=True)
    z: float = parameter(_SPEED, "mean wind, fixed frame", 0.0, live=True)
    gust: float = parameter(
        Number("m/s", minimum=0.0, maximum=100.0),
        "standard deviation of the gusts, each axis",
        0.0,
        live=True,
    )
    gust_time: float = parameter(
        Number("s", minimum=0.001), "how long a gust lasts (correlation time)", 1.0, live=True
    )


class QuadrotorSimulatorParameters(SimulatorParameters):
    """Parameters of `QuadrotorSimulatorNode`."""

    model: str = parameter(
        VEHICLE_MODEL,
        "type of the vehicle, or model file; one with lags is flown without the inner loops",
        "cf21",
    )
    mass_error: float = parameter(
        _ERROR, "how much heavier than nominal the vehicle is, as a fraction", 0.0, live=True
    )
    thrust_error: float = parameter(
        _ERROR, "how much more than nominal its rotors lift, as a fraction", 0.0, live=True
    )
    ground_effect: bool = parameter(
        BOOLEAN, "whether the rotors lift more near the ground; not with a model with lags", False
    )
    wind: WindParameters = group(WindParameters, "wind")


class QuadrotorSimulatorNode(SimulatorNode):
    """A full Crazyflie: a rigid body with four motors and the firmware's inner loops.

    A model with lags, as `identify` finds them, is a `FirstOrderQuadrotor` with its delay.
    """

    parameters_type = QuadrotorSimulatorParameters
    max_tilt = CRASH_TILT

    air: Air | None = None  #: Air that this vehicle and others of the process move; None for none.

    @override
    def make_dynamics(self, parameters: QuadrotorSimulatorParameters) -> Dynamics:
        wind = parameters.wind
        # The air is the same for all vehicles with the same seed.
        self._wind = Wind((wind.x, wind.y, wind.z), wind.gust, wind.gust_time, parameters.seed)
        model = self._model = vehicle_model.load(parameters.model)
        if model.roll_lag is not None:
            self.delay = model.delay
            self._quadrotor = None
            return FirstOrderQuadrotor(model)
        self._quadrotor = StabilizedQuadrotor(
            model,
            wind=self._wind.velocity,
            wake=None if self.air is None else partial(self.air.move, self),
        )
        self._set_airframe(parameters)
        return self._quadrotor

    @override
    def reconfigure(self, parameters: QuadrotorSimulatorParameters) -> None:
        super().reconfigure(parameters)
        wind = parameters.wind
        self._wind.change((wind.x, wind.y, wind.z), wind.gust, wind.gust_time)
        self._set_airframe(parameters)

    def _set_airframe(self, parameters):
        if self._quadrotor is not None:
            self._quadrotor.airframe = Airframe(
                self._model.with_errors(parameters.mass_error, parameters.thrust_error),
                ground_effect if parameters.ground_effect else None,
            )
