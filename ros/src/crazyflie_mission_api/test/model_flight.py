"""A dry_run flown by the model of the vehicle under a controller, all vehicles at once."""

from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import pdist

from crazyflie_lqr.gain_file import load_matrix
from crazyflie_mission_api import DryRun
from crazyflie_model.dynamics import Coupled7D, rk4_step
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_model.units import GRAVITY

STEP = 0.05  #: From one control to the next, s.


class Flight(NamedTuple):
    """Positions of the model during a flight (m)."""

    error: float
    """Largest distance of a vehicle from where it was told to be."""
    distance: float
    """Least distance of two vehicles."""
    at_limit: float
    """Share of controls at a limit."""


def fly(group: DryRun, mission, gain_file: str) -> Flight:
    """Rehearse a mission, and have the model follow it."""
    trajectories = {name: [] for name in group.names}
    for name, vehicle in group._vehicles.items():
        begin = vehicle._fly

        def note(*plan, name=name, vehicle=vehicle, begin=begin):
            answer = begin(*plan)
            trajectories[name].append(vehicle.trajectory)
            return answer

        vehicle._fly = note
    starts = np.array([group.position(name) for name in group.names])
    mission(group)
    times = np.arange(0.0, group.time(), STEP)
    places = np.stack([_places(trajectories[name], times) for name in group.names], axis=1)
    velocities = np.gradient(places, STEP, axis=0)
    return _follow(starts, places, velocities, load_matrix(gain_file, 4, 7))


def _places(trajectories, times):
    places = trajectories[0].positions(times)
    for trajectory in trajectories[1:]:
        later = times >= trajectory.begin
        places[later] = trajectory.positions(times[later])
    return places


def _follow(starts, places, velocities, gains):
    model = Coupled7D()
    x = [*starts.T, *np.zeros((4, len(starts)))]
    errors, distances, at_limit = [], [], []
    for k, (place, velocity) in enumerate(zip(places, velocities, strict=True)):
        error = np.stack(x, axis=-1)
        error[:, :6] -= np.hstack([place, velocity])
        u = error @ gains.T + [0.0, 0.0, 0.0, GRAVITY]
        limited = np.clip(
            u, [-MAX_TILT, -MAX_TILT, -9.0, MIN_THRUST], [MAX_TILT, MAX_TILT, 9.0, MAX_THRUST]
        )
        x = model.apply_ground_contact(rk4_step(model.rates, k * STEP, x, [*limited.T], STEP))
        errors.append(np.linalg.norm(error[:, :3], axis=1).max())
        distances.append(pdist(np.stack(x[:3], axis=-1)).min())
        at_limit.append((u != limited).mean())
    return Flight(max(errors), min(distances), float(np.mean(at_limit)))
