"""Simulator of a vehicle with a lagging yaw rate."""

from typing_extensions import override

from crazyflie_model.dynamics import Dynamics
from crazyflie_simulator.simulator_node import SimulatorNode, SimulatorParameters
from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import TIME_STEP
from yaw_lag.dynamics import YawLag
from yaw_lag.gains import TIME_CONSTANT


class YawLagSimulatorParameters(SimulatorParameters):
    """Parameters of `YawLagSimulatorNode`."""

    yaw_time_constant: float = parameter(TIME_STEP, "lag of the yaw rate", TIME_CONSTANT)


class YawLagSimulatorNode(SimulatorNode):
    """A vehicle whose yaw rate follows its command with a lag."""

    parameters_type = YawLagSimulatorParameters

    @override
    def make_dynamics(self, parameters: YawLagSimulatorParameters) -> Dynamics:
        return YawLag(parameters.yaw_time_constant)
