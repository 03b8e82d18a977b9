"""Simulator of a vehicle with a lagging yaw rate."""

from crazyflie_model.dynamics import Dynamics
from crazyflie_simulator.simulator_node import SimulatorNode
from crazyflie_utils.parameter_types import Number
from yaw_lag.dynamics import YawLag
from yaw_lag.gains import TIME_CONSTANT


class YawLagSimulatorNode(SimulatorNode):
    """Own parameter: ~yaw_time_constant (s)."""

    def load_dynamics(self, handle) -> Dynamics:
        """See `SimulatorNode.load_dynamics`."""
        return YawLag(handle.param("yaw_time_constant", Number(unit="s", above=0.0), TIME_CONSTANT))
