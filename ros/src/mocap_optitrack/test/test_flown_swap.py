"""Twenty virtual vehicles that know only their markers exchange their places in simulated time.

Each is sent the position that the tracker finds for it in the virtual cameras' NatNet frames, with
reflections, occlusions and markers that are missing in single frames.
"""

import struct
from typing import Any

import numpy as np
import pytest
from swarm_scenes import RATE
from test_single_markers import VirtualCameras

from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle
from mocap_optitrack.marker_tracker import MarkerTracker, MarkerVehicle

DISTURBANCES = {"ghosts": 0.3, "occlusions": 0.2, "dropout": 0.02}
GAP, STEP_ASIDE = 1.0, 0.4
"""Between the two of a pair, along y, and how far each gives way to the other along x, m."""

_HIGH_LEVEL, _EXTERNAL_POSITION = bytes([8 << 4]), bytes([6 << 4])
TAKEOFF_TIME, ASIDE_TIME, ACROSS_TIME, LANDING_TIME, END = 2.0, 5.0, 7.5, 10.5, 14.0


class Swarm:
    """Pairs of vehicles, the tracker, and the cameras."""

    def __init__(self, n: int):
        pairs = np.arange(n) // 2
        self.starts = np.column_stack((2.0 * (pairs % 4), 2.0 * (pairs // 4), np.zeros(n)))
        self.starts[:, 1] += GAP * (np.arange(n) % 2)
        self.goals = self.starts[np.arange(n) ^ 1]
        self._vehicles = [self._vehicle(x, y) for x, y, _ in self.starts]
        named = [MarkerVehicle(str(k), tuple(start)) for k, start in enumerate(self.starts)]
        self._tracker = MarkerTracker(named)
        self._cameras = VirtualCameras("4.1", **DISTURBANCES)
        self.tracked = self.swaps = self.frames = 0

    @staticmethod
    def _vehicle(x: float, y: float) -> VirtualVehicle:
        settings: dict[str, Any] = {"init_x": x, "init_y": y, "positioning": "none"}
        return VirtualVehicle(VehicleSettings(**settings))

    @property
    def positions(self) -> np.ndarray:
        """True positions, (n, 3), m."""
        return np.array([vehicle.physics.position for vehicle in self._vehicles])

    def advance_to(self, time: float) -> None:
        """Fly until a frame is there, and send each vehicle its position in it."""
        for vehicle in self._vehicles:
            vehicle.advance_to(time)
        positions = self.positions
        found = self._tracker.update(time, self._cameras.see(time, positions))
        for k, vehicle in enumerate(self._vehicles):
            self.frames += 1
            if (place := found.get(str(k))) is None:
                continue
            vehicle.receive(_EXTERNAL_POSITION + struct.pack("<fff", *place))
            errors = np.linalg.norm(positions - np.array(place), axis=1)
            self.tracked += errors[k] < 0.05
            self.swaps += errors.argmin() != k and errors.min() < 0.05

    def command(self, form: str, *values: Any) -> None:
        """Send all vehicles a high-level command; arrays have a number for each."""
        for k, vehicle in enumerate(self._vehicles):
            own = [value[k] if isinstance(value, np.ndarray) else value for value in values]
            (answer,) = vehicle.receive(_HIGH_LEVEL + struct.pack(form, *own))
            assert answer[-1] == 0, (k, own)

    def go_to(self, x: np.ndarray, y: np.ndarray, duration: float) -> None:
        """Send all to positions (m) at a height of 1 m, in a duration (s)."""
        self.command("<BB??5f", 12, 0, False, False, x, y, 1.0, 0.0, duration)


# test_single_markers.py moves them without flying.
@pytest.mark.long
def test_twenty_virtual_vehicles_exchange_their_places():
    n = 20
    swarm = Swarm(n)
    middle = swarm.starts + 0.5 * (swarm.goals - swarm.starts)
    aside = middle[:, 0] + STEP_ASIDE * np.where(np.arange(n) % 2, 1.0, -1.0)
    plan = {
        TAKEOFF_TIME: lambda: swarm.command("<BBff?f", 7, 0, 1.0, 0.0, True, 2.0),
        ASIDE_TIME: lambda: swarm.go_to(aside, middle[:, 1], 2.0),
        ACROSS_TIME: lambda: swarm.go_to(swarm.goals[:, 0], swarm.goals[:, 1], 2.0),
        LANDING_TIME: lambda: swarm.command("<BBff?f", 8, 0, 0.0, 0.0, True, 2.5),
    }
    nearest = np.inf
    for frame in range(1, round(END * RATE) + 1):
        swarm.advance_to(frame / RATE)
        for time in [time for time in plan if time <= frame / RATE]:
            if time == LANDING_TIME:
                goals = swarm.goals + (0.0, 0.0, 1.0)
                assert np.linalg.norm(swarm.positions - goals, axis=1).max() < 0.05
            plan.pop(time)()
        places = swarm.positions
        distances = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
        nearest = min(nearest, distances[np.triu_indices(n, 1)].min())
    assert np.all(swarm.positions[:, 2] < 0.05)
    assert nearest > 0.5
    assert swarm.swaps == 0
    assert swarm.tracked > 0.85 * swarm.frames
