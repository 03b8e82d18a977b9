"""ROS interface of descents that lead beside the vehicles beneath."""

from functools import partial

from typing_extensions import override

from crazyflie_fleet.fleet_config import VehicleConfig
from crazyflie_fleet.safe_descents import SafeDescents
from crazyflie_fleet.vehicle_nodes import DESCENT, SAFE_DESCENT
from crazyflie_fleet.vehicle_states import VehicleStates
from crazyflie_msgs.msg import FlightStatus, PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils import Node, NodeHandle


class SafeDescentsNode(Node):
    """Pass on the references of descents, beside vehicles that are beneath.

    ``vehicles`` are flown in this process; ``states`` and collision ``buffers`` (m) are those of
    all vehicles, these first.
    """

    needed_in_flight = True

    def __init__(
        self, vehicles: tuple[VehicleConfig, ...], states: VehicleStates, buffers: list[float]
    ):
        self._vehicles = vehicles
        self._states = states
        self._descents = SafeDescents(buffers)

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        pass

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        for number, vehicle in enumerate(self._vehicles):
            top, message_type = f"/{vehicle.name}/", PositionVelocityStateStamped
            publisher = handle.publisher(top + SAFE_DESCENT, message_type)
            on_descent = partial(self._on_descent, number, publisher)
            handle.subscribe(top + DESCENT, message_type, on_descent)

    def _on_descent(self, number, publisher, message):
        now, states = self._handle.time(), self._states
        if not self._descents.is_under_way(number, now):
            is_descending = states.flight_states == FlightStatus.DESCENDING
            is_landing = is_descending | ~states.are_in_flight()
            distance = self._descents.begin(number, now, states.positions, is_landing)
            if distance > 0.0:
                self._handle.warn(
                    f"{states.names[number]} lands {distance:.2f} m aside: another vehicle is "
                    "beneath it"
                )
        aside = self._descents.reference(number, now, message.state.z, message.state.z_dot)
        if aside is not None:
            message = PositionVelocityStateStamped(message.header, PositionVelocityState(*aside))
        publisher.publish(message)
