"""ROS interface of the velocities: two services."""

import random

from typing_extensions import override

from crazyflie_sweep.velocities import oscillator_velocity, random_velocities
from crazyflie_tutorial_msgs.srv import Velocity, VelocityAt, VelocityAtResponse, VelocityResponse
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import SERVICE, Integer


class VelocityServerParameters(Parameters):
    """Parameters of `VelocityServerNode`."""

    random_service: str = parameter(
        SERVICE, "two random velocities in an interval", "velocity", "srv/velocity"
    )
    oscillator_service: str = parameter(
        SERVICE, "the oscillator's velocity at a position", "oscillator", "srv/oscillator"
    )
    seed: int | None = parameter(
        Integer(0, 2**32 - 1), "of the random velocities; without it each run has others", None
    )


class VelocityServerNode(Node):
    """Answer calls for velocities."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(VelocityServerParameters)
        self._random = random.Random(self._parameters.seed)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        handle.advertise_service(parameters.random_service, Velocity, self._on_random)
        handle.advertise_service(parameters.oscillator_service, VelocityAt, self._on_oscillator)

    def _on_random(self, request):
        return VelocityResponse(*random_velocities(request.min, request.max, self._random))

    def _on_oscillator(self, request):
        return VelocityAtResponse(oscillator_velocity(request.x))
