"""Tracker: from a system's frames to published poses."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from crazyflie_model.angles import Quaternion, Triple
from mocap_optitrack.bodies import Body, SingleMarker
from mocap_optitrack.frame_times import ClockOffset, FrameOrder
from mocap_optitrack.frames import Frame, normalized, to_z_up
from mocap_optitrack.health import Health
from mocap_optitrack.marker_tracker import MarkerTracker

#: Largest time of a stamp ahead of its arrival (s): the offset of the server's clock is known to a
#: millisecond or two.
_LEAD = 0.005

_UPRIGHT = (0.0, 0.0, 0.0, 1.0)

_RESET = 1.0  #: Smallest step back of local time at the reset of a simulation (s).


class BodyPose(NamedTuple):
    """A body at its measured pose."""

    body: Body
    time: float  #: Time by the local clock (s).
    position: Triple  #: m, z up.
    quaternion: Quaternion | None  #: Norm 1; None for a single marker.


class Tracker:
    """Finds the configured bodies in frames and drops what is invalid or stale.

    A frame is used once: one that is not newer than the last one is dropped. So is one that is
    older than `Health.stale_after` on arrival, or from the future, or from another server's clock.
    Bodies of a frame that were not tracked, or whose pose is invalid, are dropped. ``up_axis`` is
    the stream's, see `frames.UP_AXES`; ``health`` counts events; ``hold_time`` (s) and ``log`` are
    those of a `MarkerTracker`.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        up_axis: str,
        health: Health,
        hold_time: float = 0.5,
        log: Callable[[str], None] = lambda text: None,
    ):
        self._markers = [body for body in bodies if isinstance(body, SingleMarker)]
        vehicles = [marker.vehicle for marker in self._markers]
        self._marker_tracker = MarkerTracker(vehicles, hold_time, log) if vehicles else None
        self._by_number: dict[str, Body] = {}
        self._by_name: dict[str, Body] = {}
        for body in bodies:
            if not isinstance(body, SingleMarker):
                self.add(body)
        self._up_axis = up_axis
        self._health = health
        self._newest = self._arrival = -math.inf
        self.restart()

    def add(self, body: Body) -> None:
        """Also find a body, by its name or its number."""
        if body.name is None:
            self._by_number[str(int(body.key))] = body
        else:
            self._by_name[body.name] = body

    def restart(self) -> None:
        """Learn the clock of another server."""
        self._clock = ClockOffset()

    def reset_lost(self) -> list[str]:
        """Expect lost vehicles with one marker at their start points; return their keys."""
        return self._marker_tracker.reset_lost() if self._marker_tracker else []

    def process(self, frame: Frame) -> list[BodyPose]:
        """Return the poses of a frame, all of one time that is later than the last frame's.

        The result is empty during the first half second of a server, in which its clock is learned.
        """
        if frame.arrival < self._arrival - _RESET:
            # Simulated time was restarted.
            self._newest = -math.inf
            self.restart()
        self._arrival = frame.arrival
        order, time = self._time_of(frame)
        if order is not FrameOrder.NEW:
            self._health.count(order)
            return []
        self._newest = time
        self._health.frame(frame.arrival, frame.arrival - time)
        poses = []
        for body in frame.bodies:
            configured = self._configured(body)
            if configured is None:
                self._health.other(body)
                continue
            pose = _pose(body, self._up_axis)
            self._health.body(configured, frame.arrival, pose is not None)
            if pose is not None:
                poses.append(BodyPose(configured, time, *pose))
        return poses + self._marker_poses(frame, time)

    def _marker_poses(self, frame, time):
        if self._marker_tracker is None:
            return []
        points = [to_z_up(self._up_axis, point, _UPRIGHT)[0] for point in frame.points]
        found = self._marker_tracker.update(time, points)
        poses = []
        for marker in self._markers:
            position = found.get(marker.key)
            why = self._marker_tracker.explain(marker.key)
            self._health.body(marker, frame.arrival, position is not None, why)
            if position is not None:
                x, y, z = (a + b for a, b in zip(position, marker.offset, strict=True))
                poses.append(BodyPose(marker, time, (x, y, z), None))
        return poses

    def _time_of(self, frame):
        # What a frame is, and if it is new, its time by the local clock (s).
        time = frame.arrival - frame.waited
        if frame.exposure is not None:
            order = self._clock.update(frame.sent, frame.arrival)
            if order is not FrameOrder.NEW:
                return order, time
            if not self._clock.is_settled:
                return FrameOrder.LEARNING, time
            time = self._clock.to_local(frame.exposure)
        age = frame.arrival - time
        if time <= self._newest:
            return FrameOrder.OLD, time
        if age < -_LEAD:
            return FrameOrder.FOREIGN, time
        return FrameOrder.STALE if age > self._health.stale_after else FrameOrder.NEW, time

    def _configured(self, body):
        # In systems without numbers, a body may be named "1".
        number = body.name if body.body_id is None else str(body.body_id)
        return self._by_number.get(number) or self._by_name.get(body.name)


def _pose(body, up_axis):
    if not body.is_tracked or not all(map(math.isfinite, body.position)):
        return None
    quaternion = normalized(body.quaternion)
    if quaternion is None:
        return None
    return to_z_up(up_axis, body.position, quaternion)
