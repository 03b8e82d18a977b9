"""Which vehicle each unlabelled marker belongs to: one marker on each vehicle."""

import math
from collections.abc import Callable, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from crazyflie_model.angles import Triple
from mocap_optitrack.marker_motion import REST_RADIUS, Marker, MotionLimits, assign

#: Least distance between the markers of two vehicles (m): a Crazyflie has 92 mm from motor to
#: motor. So a gate of half of it contains the marker of at most one vehicle.
SEPARATION = 0.1

#: Largest distance of a marker from its vehicle's start point (m), unless another start point is
#: nearer than three times as much.
START_RADIUS = 0.25

_GROUND = 0.1  #: Largest height above its first place of a vehicle on the ground (m).

#: Times after which a vehicle without poses has stopped, and is on the ground (s):
#: crazyflie_takeoff's filter ends its motion and lets it sink.
_STOP_TIME, _FALL_TIME = 1.0, 5.0

#: Time after which an unseen marker of no vehicle is forgotten (s); one that `flashes`, at once.
_FORGET_TIME = 0.1


class MarkerVehicle(NamedTuple):
    """A vehicle with one marker."""

    name: str
    start: Triple  #: Position of its marker before the first flight, z up (m).
    limits: MotionLimits = MotionLimits()


class TrackState(Enum):
    """Knowledge of a vehicle's marker.

    ======= ============================================================ =======
    state   event                                                        next
    ======= ============================================================ =======
    UNSEEN  one marker rests near its start point                        TRACKED
    TRACKED so long unseen that its gate is wider than half `SEPARATION` HELD
    TRACKED two assignments are nearly as good                           HELD
    HELD    one new marker is within its gate                            TRACKED
    HELD    the hold time is over                                        LOST
    LOST    one new marker rests on the ground where it was seen last    TRACKED
    LOST    `MarkerTracker.reset_lost`: it has been put at its start     UNSEEN
            point
    ======= ============================================================ =======

    A marker that may be that of another vehicle in `UNSEEN`, `HELD` or `LOST` is taken by none.
    """

    UNSEEN = "has not been seen"
    TRACKED = "is tracked"
    HELD = "is not seen for a moment"
    LOST = "is lost"


class TrackedVehicle:
    """A vehicle and its marker, which is not defined while the state is `TrackState.UNSEEN`."""

    marker: Marker

    def __init__(self, config: MarkerVehicle, starts: npt.NDArray[np.float64]):
        self.name, self.start, self._limits = config
        distances = np.linalg.norm(starts - config.start, axis=1)
        # The nearest start point is the vehicle's own.
        nearest = np.sort(distances)[1] if len(starts) > 1 else math.inf
        self.start_radius = min(START_RADIUS, float(nearest) / 3.0)
        self.state = TrackState.UNSEEN

    @property
    def rested(self) -> bool:
        """Whether the vehicle was on the ground when it was lost."""
        return self.state is TrackState.LOST and self.marker.rests and self._is_low()

    def take(self, marker: Marker) -> None:
        """Follow a marker from now on."""
        if self.state is TrackState.UNSEEN:
            self._ground = marker.measured[2]
        self.marker, self.state = marker, TrackState.TRACKED
        marker.limits = self._limits

    def accepts(self, marker: Marker, time: float) -> bool:
        """Return whether a marker may be assigned to the vehicle."""
        if marker.time != time or not self.may_be(marker, time):
            return False
        if self.state is TrackState.HELD:
            return True
        if not marker.rests:
            return False
        if self.state is TrackState.UNSEEN:
            return True
        radius = 2.0 * REST_RADIUS if self.rested else self.start_radius
        distance = math.dist(marker.measured[:2], self.marker.measured[:2])
        return self._is_low(marker) and distance <= radius

    def may_be(self, marker: Marker, time: float) -> bool:
        """Return whether a marker may be the vehicle's, by what is physically possible."""
        point = marker.measured
        if self.state is TrackState.UNSEEN:
            return math.dist(point, self.start) <= self.start_radius
        if marker.first_seen <= self.marker.time:
            return False
        if self.state is TrackState.HELD:
            return bool(np.isfinite(self.marker.costs(time, point[np.newaxis])[0]))
        unseen = time - self.marker.time
        if not self.rested and unseen < _FALL_TIME:
            return bool(self.marker.can_reach(point, min(unseen, _STOP_TIME)))
        # On the ground a vehicle may be carried anywhere.
        return self._is_low(marker)

    def _is_low(self, marker: Marker | None = None) -> bool:
        return bool((marker or self.marker).measured[2] <= self._ground + _GROUND)


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
        velocities, accelerations = zip(*(vehicle.limits for vehicle in vehicles), strict=True)
        x, y, z = np.max(velocities, axis=0)
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
                vehicle.state = TrackState.UNSEEN
        self._strangers = [
            stranger
            for stranger in self._strangers
            if stranger.time == self._time
            or (not stranger.flashes and time - stranger.time <= _FORGET_TIME)
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
            if vehicle.state is TrackState.TRACKED and vehicle.marker.time == time
            for x, y, z in [vehicle.marker.measured]
        }

    def reset_lost(self) -> list[str]:
        """Expect the lost vehicles at their start points; return their names."""
        lost = [vehicle for vehicle in self._vehicles if vehicle.state is TrackState.LOST]
        for vehicle in lost:
            vehicle.state = TrackState.UNSEEN
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
        x, y, z = vehicle.marker.measured if is_lost else vehicle.start
        distances = [math.dist(each.measured, (x, y, z)) for each in self._strangers]
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
        for vehicle in self._vehicles:
            if vehicle.state is TrackState.TRACKED:
                if vehicle.marker.radius(self._time) > SEPARATION / 2.0:
                    vehicle.state = TrackState.HELD
            if vehicle.state is TrackState.HELD:
                unseen = self._time - vehicle.marker.time
                if unseen > self._hold_time:
                    vehicle.state = TrackState.LOST
                    x, y, z = vehicle.marker.measured
                    self._log(
                        f"{vehicle.name} is lost: its marker was last seen at ({x:.2f}, {y:.2f}, "
                        f"{z:.2f}), {unseen:.1f} s ago"
                    )

    def _follow(self, cloud):
        tracked = [each for each in self._vehicles if each.state is TrackState.TRACKED]
        markers = [*(vehicle.marker for vehicle in tracked), *self._strangers]
        pairs, ambiguous = assign(markers, self._time, cloud)
        unsure = [vehicle for row, vehicle in enumerate(tracked) if row in ambiguous]
        for vehicle in unsure:
            vehicle.state = TrackState.HELD
        if unsure:
            # Their points may belong to markers that were ignored.
            self._follow(cloud)
            return
        for row, column in pairs.items():
            markers[row].update(self._time, cloud[column])
        free = sorted(set(range(len(cloud))) - set(pairs.values()))
        self._strangers += [Marker(self._time, cloud[index], self._widest) for index in free]

    def _recover(self):
        missing = [each for each in self._vehicles if each.state is not TrackState.TRACKED]
        candidates = {
            vehicle.name: [each for each in self._strangers if vehicle.accepts(each, self._time)]
            for vehicle in missing
        }
        for vehicle in missing:
            others = [other for other in missing if other is not vehicle]
            match candidates[vehicle.name]:
                case [found] if not found.flashes and not any(
                    other.may_be(found, self._time) and not _is_elsewhere(other, candidates, found)
                    for other in others
                ):
                    if vehicle.state is TrackState.LOST:
                        self._log(f"{vehicle.name} is tracked again")
                    vehicle.take(found)
                    self._strangers.remove(found)


def _is_elsewhere(vehicle, candidates, marker):
    """Return whether a vehicle, lost on the ground, has another marker at its very place."""
    own = candidates[vehicle.name]
    return vehicle.rested and len(own) == 1 and own[0] is not marker
