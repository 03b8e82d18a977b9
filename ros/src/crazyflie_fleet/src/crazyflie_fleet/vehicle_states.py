"""States and flight states of the vehicles of a fleet, as received."""

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray

from crazyflie_fleet.fleet_config import VehicleConfig
from crazyflie_fleet.vehicle_nodes import FLIGHT_STATUS, STATE
from crazyflie_model.polynomials import Goal
from crazyflie_msgs.msg import FlightStatus, PositionVelocityYawStateStamped
from crazyflie_takeoff.motion import MAX_POSITION_AGE
from crazyflie_utils import NodeHandle
from crazyflie_utils.vectors import to_tuple

_IN_FLIGHT = (FlightStatus.TAKING_OFF, FlightStatus.FLYING, FlightStatus.DESCENDING)


class VehicleStates:
    """The last states and flight states of vehicles, which have numbers in the order given.

    ``vectorized`` are topics with the states of several of them in one message.
    """

    def __init__(
        self,
        vehicles: Sequence[VehicleConfig],
        vectorized: Mapping[str, Sequence[VehicleConfig]],
    ):
        self.names = [vehicle.name for vehicle in vehicles]
        #: Shape (n,); `FlightStatus.state` of each; UNKNOWN before the first.
        self.flight_states = np.full(len(vehicles), FlightStatus.UNKNOWN)
        #: Reason for which each vehicle would refuse a takeoff; empty if it would not.
        self.takeoff_refusals = [
            f"nothing has come on /{name}/{FLIGHT_STATUS}" for name in self.names
        ]
        self._vectorized = vectorized
        self._states = np.full((len(vehicles), 7), np.nan)
        self._times = np.full(len(vehicles), -np.inf)

    @property
    def positions(self) -> NDArray[np.float64]:
        """Last positions, shape (n, 3), m, fixed frame; NaN before the first."""
        return self._states[:, :3]

    @property
    def velocities(self) -> NDArray[np.float64]:
        """Last velocities, shape (n, 3), m/s, fixed frame; NaN before the first."""
        return self._states[:, 3:6]

    @property
    def headings(self) -> NDArray[np.float64]:
        """Last headings, shape (n,), rad; NaN before the first."""
        return self._states[:, 6]

    def subscribe(self, handle: NodeHandle) -> None:
        """Subscribe to the topics of all vehicles through the handle of a node."""
        self._handle = handle
        for number, name in enumerate(self.names):
            on_status = partial(self._on_flight_status, number)
            handle.subscribe(f"/{name}/{FLIGHT_STATUS}", FlightStatus, on_status)
        scalar = {name: number for number, name in enumerate(self.names)}
        for topic, vehicles in self._vectorized.items():
            numbers = np.array([scalar.pop(vehicle.name) for vehicle in vehicles])
            handle.subscribe(topic, Float64MultiArray, partial(self._on_states, numbers))
        for name, number in scalar.items():
            on_state = partial(self._on_state, number)
            handle.subscribe(f"/{name}/{STATE}", PositionVelocityYawStateStamped, on_state)

    def are_fresh(self) -> NDArray[np.bool_]:
        """Return which positions are finite and younger than `MAX_POSITION_AGE`, shape (n,)."""
        age = self._handle.time() - self._times
        return (age >= 0.0) & (age < MAX_POSITION_AGE) & np.isfinite(self.positions).all(axis=1)

    def goal(self, number: int) -> Goal[float] | None:
        """Return position, velocity and heading of one as a goal; None if they are not fresh."""
        # For one of a hundred vehicles that move, as `are_fresh` for all would take longer.
        age = self._handle.time() - self._times.item(number)
        x, y, z, *velocity, yaw = self._states[number].tolist()
        if not (0.0 <= age < MAX_POSITION_AGE and math.isfinite(x + y + z)):
            return None
        return Goal((x, y, z), tuple(velocity), (0.0, 0.0, 0.0), yaw, 0.0)

    def are_in_flight(self) -> NDArray[np.bool_]:
        """Return which vehicles are in flight, so that others must keep apart, shape (n,)."""
        return np.isin(self.flight_states, _IN_FLIGHT)

    def flying(self) -> set[str]:
        """Return the names of those in flight."""
        return {self.names[number] for number in np.flatnonzero(self.are_in_flight())}

    def _on_state(self, number, message):
        self._states[number] = to_tuple(message.state)
        self._times[number] = self._handle.time()

    def _on_states(self, numbers, message):
        if len(message.data) != 7 * len(numbers):
            self._handle.warn(
                f"ignoring {len(message.data)} numbers as states of {len(numbers)} vehicles",
                throttle=1.0,
                key="states",
            )
            return
        self._states[numbers] = np.reshape(message.data, (-1, 7))
        self._times[numbers] = self._handle.time()

    def _on_flight_status(self, number, message):
        self.flight_states[number] = message.state
        self.takeoff_refusals[number] = message.takeoff_refusal
