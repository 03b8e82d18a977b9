"""Which vehicle each unlabelled marker belongs to: one marker on each vehicle."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from crazyflie_model.angles import Triple
from mocap_optitrack.marker_motion import MarkerMotion, MotionLimits, assign
from mocap_optitrack.marker_vehicle import (
    FORGET_TIME,
    SEPARATION,
    Marker,
    MarkerVehicle,
    TrackedVehicle,
    TrackState,
)


class MarkerTracker:
    """Assigns the unlabelled markers of frames to vehicles.

    All markers have a track, also those without a vehicle: a reflection that was present before a
    vehicle was lost is not mistaken for the vehicle. If vehicles keep their maximum velocities and
    accelerations and their markers are `SEPARATION` apart, no vehicle gets the marker of another:
    when two are possible, none is taken. A vehicle may be unseen in flight for ``hold_time`` (s);
    ``log(text)`` is called about each that is lost, and that is found again.
    """

    def __init__(
        self,
        vehicles: Sequence[MarkerVehicle],
        hold_time: float = 0.5,
        log: Callable[[str], None] = lambda text: None,
    ):
        self._hold_time = hold_time
        self._log = log
        starts = np.array([vehicle.start for vehicle in vehicles], dtype=float)
        self._vehicles = [TrackedVehicle(vehicle, starts) for vehicle in vehicles]
        self._by_name = {vehicle.name: vehicle for vehicle in self._vehicles}
        velocities = [vehicle.limits.max_velocity for vehicle in vehicles]
        x, y, z = np.max(velocities, axis=0)
        accelerations = [vehicle.limits.max_acceleration for vehicle in vehicles]
        self._widest = MotionLimits((x, y, z), max(accelerations))
        self._strangers: list[Marker] = []
        self._time = -math.inf
        self._n_points = 0

    def update(self, time: float, points: Sequence[Triple]) -> dict[str, Triple]:
        """Return the measured positions (m) of the vehicles whose markers are in a frame.

        The vehicles are `UNSEEN` again when its time (s) is before the last one's. ``points`` are
        its unlabelled markers, m, z up; those that are not finite are ignored.
        """
        if time <= self._time:
            self._strangers = []
            for vehicle in self._vehicles:
                vehicle.forget()
        self._strangers = [
            stranger
            for stranger in self._strangers
            if stranger.motion.time == self._time
            or (not stranger.flashes and time - stranger.motion.time <= FORGET_TIME)
        ]
        self._time = time
        cloud = np.array(points, dtype=float).reshape(-1, 3)
        cloud = cloud[np.isfinite(cloud).all(axis=1)]
        self._n_points = len(cloud)
        self._expire()
        self._follow(cloud)
        self._recover()
        return {
            vehicle.name: (float(x), float(y), float(z))
            for vehicle in self._vehicles
            if vehicle.state is TrackState.TRACKED and vehicle.motion.time == time
            for x, y, z in [vehicle.motion.measured]
        }

    def reset_lost(self) -> list[str]:
        """Expect the lost vehicles at their start points; return their names."""
        lost = [vehicle for vehicle in self._vehicles if vehicle.state is TrackState.LOST]
        for vehicle in lost:
            vehicle.forget()
        return [vehicle.name for vehicle in lost]

    def explain(self, name: str) -> str:
        """Return what keeps a vehicle from being tracked; empty when it is tracked."""
        vehicle = self._by_name[name]
        if vehicle.state is TrackState.TRACKED:
            return ""
        if not self._n_points:
            return (
                f"its marker {vehicle.state.value}: there is no unlabelled marker in the stream; "
                "in Motive, switch on 'Unlabeled Markers' in the settings of data streaming"
            )
        is_lost = vehicle.state is TrackState.LOST
        x, y, z = vehicle.motion.measured if is_lost else vehicle.start
        distances = [math.dist(each.motion.measured, (x, y, z)) for each in self._strangers]
        nearest = (
            f"the nearest of no vehicle is {min(distances):.2f} m away"
            if distances
            else ("all markers are those of other vehicles")
        )
        place = "on the ground where it was seen last" if is_lost else "at its start point"
        text = (
            f"its marker {vehicle.state.value}; expected one marker that rests {place}, within "
            f"{vehicle.start_radius:.2g} m of ({x:.2f}, {y:.2f}, {z:.2f}), and that no other "
            f"missing vehicle may have; {nearest}"
        )
        return f"{text}. Or put it at its start point and call reset_lost" if is_lost else text

    def _expire(self):
        time = self._time
        for vehicle in self._vehicles:
            if (
                vehicle.state is TrackState.TRACKED
                and vehicle.motion.radius(time) > SEPARATION / 2.0
            ):
                vehicle.state = TrackState.HELD
            if vehicle.state is TrackState.HELD and time - vehicle.motion.time > self._hold_time:
                vehicle.state = TrackState.LOST
                x, y, z = vehicle.motion.measured
                self._log(
                    f"{vehicle.name} is lost: its marker was last seen at ({x:.2f}, {y:.2f}, "
                    f"{z:.2f}), {time - vehicle.motion.time:.1f} s ago"
                )

    def _follow(self, cloud):
        tracked = [each for each in self._vehicles if each.state is TrackState.TRACKED]
        markers = [*(vehicle.marker for vehicle in tracked), *self._strangers]
        pairs, ambiguous = assign([marker.motion for marker in markers], self._time, cloud)
        unsure = [vehicle for row, vehicle in enumerate(tracked) if row in ambiguous]
        for vehicle in unsure:
            vehicle.state = TrackState.HELD
        if unsure:
            # Their points may belong to markers that were ignored.
            self._follow(cloud)
            return
        for row, column in pairs.items():
            markers[row].see(self._time, cloud[column])
        free = sorted(set(range(len(cloud))) - set(pairs.values()))
        self._strangers += [
            Marker(MarkerMotion(self._time, cloud[index], self._widest)) for index in free
        ]

    def _recover(self):
        missing = [each for each in self._vehicles if each.state is not TrackState.TRACKED]
        candidates = {
            vehicle.name: [each for each in self._strangers if vehicle.accepts(each, self._time)]
            for vehicle in missing
        }
        for vehicle in missing:
            if len(candidates[vehicle.name]) != 1:
                continue
            (found,) = candidates[vehicle.name]
            others = [
                other
                for other in missing
                if other is not vehicle and other.may_be(found, self._time)
            ]
            if found.flashes or not all(_is_elsewhere(each, candidates, found) for each in others):
                continue
            if vehicle.state is TrackState.LOST:
                self._log(f"{vehicle.name} is tracked again")
            vehicle.take(found)
            self._strangers.remove(found)


def _is_elsewhere(vehicle, candidates, marker):
    """Return whether a vehicle, lost on the ground, has another marker at its very place."""
    own = candidates[vehicle.name]
    return vehicle.rested and len(own) == 1 and own[0] is not marker
