"""Where the vehicles of a fleet are, and whether they fly, as far as messages say."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray, String

from crazyflie_fleet.fleet import Vehicle
from crazyflie_fleet.stack import FLIGHT_STATE, STATE
from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_utils import NodeHandle
from crazyflie_utils.vectors import to_tuple

STATE_LIMIT = 0.5
"""A state older than this says nothing about where its vehicle is, s."""

FLYING, DESCENDING = "flying", "descending"
IN_FLIGHT = ("taking_off", FLYING, DESCENDING)
"""Flight states of vehicles that others have to keep apart from."""


class Sightings:
    """States and flight states of vehicles, which have numbers in the order given.

    Parameters
    ----------
    vehicles : sequence of Vehicle
    swarms : mapping of str to sequence of Vehicle
        Topics that have the states of some of them in one message.

    Attributes
    ----------
    names : list of str
    positions, velocities : ndarray, shape (n, 3)
        The last ones that have come, m and m/s, fixed frame; NaN before the first.
    flight_states : list of str
        As takeoff servers publish them; empty before the first.
    """

    def __init__(self, vehicles: Sequence[Vehicle], swarms: Mapping[str, Sequence[Vehicle]]):
        self.names = [vehicle.name for vehicle in vehicles]
        self.flight_states = [""] * len(vehicles)
        self._swarms = swarms
        self._states = np.full((len(vehicles), 6), np.nan)
        self._times = np.full(len(vehicles), -np.inf)

    @property
    def positions(self) -> NDArray[np.float64]:  # noqa: D102, as documented above
        return self._states[:, :3]

    @property
    def velocities(self) -> NDArray[np.float64]:  # noqa: D102
        return self._states[:, 3:]

    def subscribe(self, handle: NodeHandle) -> None:
        """Hear of all vehicles through the handle of a node."""
        self._handle = handle
        for number, name in enumerate(self.names):
            on_flight_state = partial(self._on_flight_state, number)
            handle.subscribe(f"/{name}/{FLIGHT_STATE}", String, on_flight_state)
        alone = {name: number for number, name in enumerate(self.names)}
        for topic, swarm in self._swarms.items():
            numbers = np.array([alone.pop(vehicle.name) for vehicle in swarm])
            handle.subscribe(topic, Float64MultiArray, partial(self._on_states, numbers))
        for name, number in alone.items():
            on_state = partial(self._on_state, number)
            handle.subscribe(f"/{name}/{STATE}", PositionVelocityYawStateStamped, on_state)

    def are_fresh(self) -> NDArray[np.bool_]:
        """Return of which vehicles it is known where they are now, shape (n,)."""
        age = self._handle.time() - self._times
        return (age >= 0.0) & (age < STATE_LIMIT) & np.isfinite(self.positions).all(axis=1)

    def are_in_flight(self) -> NDArray[np.bool_]:
        """Return which vehicles fly, by their flight states, shape (n,)."""
        return np.array([state in IN_FLIGHT for state in self.flight_states])

    def flying(self) -> set[str]:
        """Return the names of those in flight."""
        return {name for name, flies in zip(self.names, self.are_in_flight(), strict=True) if flies}

    def _on_state(self, number, message):
        self._states[number] = to_tuple(message.state)[:6]
        self._times[number] = self._handle.time()

    def _on_states(self, numbers, message):
        if len(message.data) != 7 * len(numbers):
            self._handle.warn(
                f"ignoring {len(message.data)} numbers as states of {len(numbers)} vehicles",
                throttle=1.0,
                key="states",
            )
            return
        self._states[numbers] = np.reshape(message.data, (-1, 7))[:, :6]
        self._times[numbers] = self._handle.time()

    def _on_flight_state(self, number, message):
        self.flight_states[number] = message.data
