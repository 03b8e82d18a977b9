"""A vehicle with one marker: its track, and its possible places."""

import math
from enum import Enum
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from crazyflie_model.angles import Triple
from mocap_optitrack.marker_motion import MarkerMotion, MotionLimits, Point

#: Least distance between the markers of two vehicles (m): a Crazyflie has 92 mm from motor to
#: motor. So a gate of half of it contains the marker of at most one vehicle.
SEPARATION = 0.1

#: Largest distance of a marker from its vehicle's start point (m), unless another start point is
#: nearer than three times as much.
START_RADIUS = 0.25

#: Size of the region (m) and time (s) in which a resting marker stays.
_REST_TIME, _REST_RADIUS = 0.5, 0.02
_GROUND = 0.1  #: Largest height above its first place of a vehicle on the ground (m).

#: Times after which a vehicle without poses has stopped, and is on the ground (s):
#: crazyflie_takeoff's filter ends its motion and lets it sink.
_STOP_TIME, _FALL_TIME = 1.0, 5.0

#: Number of frames in which a marker must be seen before it is assigned to a vehicle: reflections
#: flash.
_LEAST_SIGHTINGS = 3
#: Time after which an unseen marker of no vehicle is forgotten (s); one that `flashes`, at once.
FORGET_TIME = 0.1


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


class Marker:
    """A marker that has been followed from frame to frame."""

    def __init__(self, motion: MarkerMotion):
        self.motion = motion
        self.first_seen = self._rests_since = motion.time
        self._rest = motion.measured
        self._sightings = 1

    def see(self, time: float, point: Point) -> None:
        """Process a measurement (m)."""
        self.motion.update(time, point)
        self._sightings += 1
        if math.dist(point, self._rest) > _REST_RADIUS:
            self._rest, self._rests_since = point, time

    @property
    def flashes(self) -> bool:
        """Whether it has been seen in too few frames to belong to a vehicle."""
        return self._sightings < _LEAST_SIGHTINGS

    @property
    def rests(self) -> bool:
        """Whether it has been at one place for a while."""
        return self.motion.time - self._rests_since >= _REST_TIME


class TrackedVehicle:
    """A vehicle and its marker."""

    marker: Marker

    def __init__(self, config: MarkerVehicle, starts: npt.NDArray[np.float64]):
        self.name, self.start, self._limits = config
        distances = np.linalg.norm(starts - config.start, axis=1)
        # The nearest start point is the vehicle's own.
        nearest = np.sort(distances)[1] if len(starts) > 1 else math.inf
        self.start_radius = min(START_RADIUS, float(nearest) / 3.0)
        self.forget()

    @property
    def motion(self) -> MarkerMotion:
        """Motion of its marker; not defined while the state is `TrackState.UNSEEN`."""
        return self.marker.motion

    @property
    def rested(self) -> bool:
        """Whether the vehicle was on the ground when it was lost."""
        return self.state is TrackState.LOST and self.marker.rests and self._is_low()

    def forget(self) -> None:
        """Expect it at its start point."""
        self.state = TrackState.UNSEEN

    def take(self, marker: Marker) -> None:
        """Follow a marker from now on."""
        if self.state is TrackState.UNSEEN:
            self._ground = marker.motion.measured[2]
        self.marker, self.state = marker, TrackState.TRACKED
        marker.motion.limits = self._limits

    def accepts(self, marker: Marker, time: float) -> bool:
        """Return whether a marker may be assigned to the vehicle."""
        if marker.motion.time != time or not self.may_be(marker, time):
            return False
        if self.state is TrackState.HELD:
            return True
        if not marker.rests:
            return False
        if self.state is TrackState.UNSEEN:
            return True
        radius = 2.0 * _REST_RADIUS if self.rested else self.start_radius
        distance = math.dist(marker.motion.measured[:2], self.motion.measured[:2])
        return self._is_low(marker) and distance <= radius

    def may_be(self, marker: Marker, time: float) -> bool:
        """Return whether a marker may be the vehicle's, by what is physically possible."""
        point = marker.motion.measured
        if self.state is TrackState.UNSEEN:
            return math.dist(point, self.start) <= self.start_radius
        if marker.first_seen <= self.motion.time:
            return False
        if self.state is TrackState.HELD:
            return bool(np.isfinite(self.motion.costs(time, point[np.newaxis])[0]))
        unseen = time - self.motion.time
        if not self.rested and unseen < _FALL_TIME:
            return bool(self.motion.can_reach(point, min(unseen, _STOP_TIME)))
        # On the ground a vehicle may be carried anywhere.
        return self._is_low(marker)

    def _is_low(self, marker: Marker | None = None) -> bool:
        return bool((marker or self.marker).motion.measured[2] <= self._ground + _GROUND)
