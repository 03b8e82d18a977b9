"""ROS interface of a simulated vehicle with motors, inner loops and wind."""

from crazyflie_model.dynamics import Dynamics
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_simulator.simulator_node import SEED, SimulatorNode
from crazyflie_simulator.wind import Wind
from crazyflie_utils.parameter_types import TIME_STEP, Number

_ERROR = Number(minimum=-0.5, maximum=0.5)
_SPEED = Number(unit="m/s")
_SPREAD = Number(unit="m/s", minimum=0.0)


class QuadrotorSimulatorNode(SimulatorNode):
    """A full Crazyflie: a rigid body with four motors and the firmware's inner loops."""

    def load_dynamics(self, handle) -> Dynamics:
        """See `SimulatorNode.load_dynamics`."""
        # The air is the same for all vehicles with the same seed.
        wind = Wind(
            mean=[handle.param(f"wind/{axis}", _SPEED, 0.0) for axis in "xyz"],
            gust=handle.param("wind/gust", _SPREAD, 0.0),
            gust_time=handle.param("wind/gust_time", TIME_STEP, 1.0),
            seed=handle.param("seed", SEED, 0),
        )
        return StabilizedQuadrotor(
            mass_error=handle.param("mass_error", _ERROR, 0.0),
            thrust_error=handle.param("thrust_error", _ERROR, 0.0),
            wind=wind.velocity,
        )
