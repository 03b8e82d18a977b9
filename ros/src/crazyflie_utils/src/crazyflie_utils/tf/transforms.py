"""tf for all nodes of a process: reception and transmission on /tf and /tf_static."""

import threading
from collections.abc import Callable, Hashable
from typing import Any

import genpy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from crazyflie_utils.tf.frame_tree import FrameTree, RawTransforms, StampedPose, encode_poses
from crazyflie_utils.topics import Subscriber, Topics

#: Largest time of a stamp ahead of now (s). tf's static_transform_publisher stamps 0.1 s ahead.
MAX_FUTURE_STAMP = 0.2
#: The same limit in simulated time (s): pose and /clock come by different paths.
MAX_FUTURE_STAMP_SIMULATED = 2.0
#: In simulated time, /clock may be this late without a warning (s): 1 s at 60 times real time.
MAX_CLOCK_DELAY_SIMULATED = 60.0


class _Listener:
    """A callback for new poses of a frame, at most once in a period (s, by their stamps)."""

    def __init__(self, period: float, callback: Callable[[], None]):
        self.callback = callback
        self._period = round(period * 1e9)
        self._due = 0

    def is_due(self, stamp: int) -> bool:
        """Return whether a pose, by its stamp in ns, is due."""
        early = self._due - stamp
        # Tolerates rounding; a much earlier stamp comes from a clock that was set back.
        if self._period // 100 < early <= 2 * self._period:
            return False
        self._due = stamp + self._period if early > 0 else max(self._due + self._period, stamp)
        return True


class Transforms:
    """The transforms that the process receives and sends on /tf and /tf_static.

    ``warn``, ``ahead`` and ``clock_delay`` are those of `FrameTree`; ``now()`` returns the present
    ROS time, ns.
    """

    def __init__(
        self,
        topics: Topics,
        warn: Callable[[str, Hashable], None],
        now: Callable[[], int],
        ahead: float,
        clock_delay: float = 0.0,
    ):
        self._topics = topics
        self._static: dict[str, TransformStamped] = {}
        self._now = now
        self._tree = FrameTree(warn, ahead, clock_delay)
        self._publisher: Any = None
        self._own: RawTransforms | None = None
        self._broadcasters = 0
        self._gathered: list[StampedPose] | None = None
        self._subscriber: Subscriber | None = None
        self._listeners: dict[str, list[_Listener]] = {}
        self._sources: list[Callable[[], None]] = []
        # Each external broadcaster has a thread of its own.
        self._lock = threading.RLock()

    def rejected_by_reason(self) -> dict[str, int]:
        """Return the numbers of transforms that were rejected in this process by reason."""
        return dict(self._tree.rejected)

    def broadcaster(self) -> Callable[[list[TransformStamped]], None]:
        """Announce /tf and return ``broadcast(list of TransformStamped)``."""
        self._advertise()
        return lambda transforms: self._publisher.publish(TFMessage(transforms))

    def pose_broadcaster(self) -> Callable[[list[StampedPose]], None]:
        """Announce /tf and return ``broadcast(list of StampedPose)``, which is quicker."""
        self._advertise()
        return self._broadcast_poses

    def static_broadcaster(self) -> Callable[[list[TransformStamped]], None]:
        """Announce /tf_static and return ``broadcast(list of TransformStamped)``.

        Transforms of earlier calls stay valid; a repeated child frame is replaced.
        """
        publisher = self._topics.publisher("/tf_static", TFMessage, latch=True)

        def broadcast(transforms: list[TransformStamped]) -> None:
            self._static.update({each.child_frame_id: each for each in transforms})
            publisher.publish(TFMessage(list(self._static.values())))

        return broadcast

    def _advertise(self):
        self._broadcasters += 1
        if self._publisher is None:
            self._publisher = self._topics.publisher("/tf", TFMessage, latch=False)

    def add_source(self, refresh: Callable[[], None]) -> None:
        """Call ``refresh()`` before timers of the process, if any node of it looks poses up.

        That is early enough to broadcast poses while `has_pose_consumers` is false.
        """
        self._sources.append(refresh)

    def has_pose_consumers(self) -> bool:
        """Return whether poses are used when they are broadcast, not only by lookups here."""
        own = int(self._subscriber is not None)
        return bool(self._listeners) or self._publisher.has_subscribers(own)

    def _broadcast_poses(self, poses):
        # A message is made only if it is received outside of this class.
        if self._subscriber is not None:
            self._take(poses)
        if not self._publisher.has_subscribers(excluding=int(self._subscriber is not None)):
            return
        if self._gathered is None:
            self._send(poses)
        else:
            self._gathered += poses

    def before_timers(self, count: int) -> list[Callable[[], None]]:
        """Return the work before ``count`` timers that are due at once.

        Of several, the poses that they broadcast are collected for one message.
        """
        works = [] if self._subscriber is None else [*self._sources]
        return [self.gather, *works] if count > 1 else works

    def gather(self) -> None:
        """Collect the poses that are broadcast from now on for one message."""
        if self._broadcasters > 1 and self._gathered is None:
            self._gathered = []

    def send_gathered(self) -> None:
        """Publish the gathered poses; from now on each broadcast is a message again."""
        poses, self._gathered = self._gathered, None
        if poses:
            self._send(poses)

    def _send(self, poses):
        self._own = encode_poses(poses)
        self._publisher.publish(self._own)

    def listener(self) -> Callable[..., TransformStamped]:
        """Begin to listen to tf and return `lookup`."""
        self._listen()
        return self.lookup

    def pose_listener(self) -> Callable[..., StampedPose]:
        """Begin to listen to tf and return `lookup_pose`."""
        self._listen()
        return self.lookup_pose

    def _listen(self):
        if self._subscriber is None:
            self._subscriber = self._topics.subscribe(
                "/tf", TFMessage, self._on_transforms, RawTransforms, lambda: not self._listeners
            )
            self._topics.subscribe("/tf_static", TFMessage, self._on_static)

    def on_pose(self, frame: str, period: float, callback: Callable[[], None]) -> None:
        """Call ``callback()`` when a pose of a frame is new; once in ``period`` (s)."""
        self._listen()
        with self._lock:
            self._listeners.setdefault(frame, []).append(_Listener(period, callback))
            self._tree.follow(frame, self._now())

    def clear(self) -> None:
        """Delete all moving frames: time has been reset."""
        with self._lock:
            self._tree.clear()

    def lookup(self, target: str, source: str, stamp: genpy.Time | None = None) -> TransformStamped:
        """Return the pose of frame ``source`` in frame ``target``, with its own stamp.

        By default, and for stamp 0, the pose is the latest. Other stamps are available for 10 s
        from the first such lookup on; before it, the last 100 transforms of frames that were looked
        up. `TransformError`: a frame is unknown, the two are not connected, or not at that time.
        """
        return self.lookup_pose(target, source, stamp).message()

    def lookup_pose(self, target: str, source: str, stamp: genpy.Time | None = None) -> StampedPose:
        """Return the result of `lookup` as a pose, which is quicker."""
        tree = self._tree
        with self._lock:
            if target not in tree.followed or source not in tree.followed:
                for frame in (target, source):
                    tree.follow(frame, self._now())
            return tree.lookup(target, source, stamp.to_nsec() if stamp else 0)

    def _on_transforms(self, message):
        if isinstance(message, RawTransforms):
            if message is not self._own:
                self._take(self._tree.read(message.raw))
        else:
            self._take(map(StampedPose.of, message.transforms))

    def _take(self, poses):
        now = self._now()
        with self._lock:
            new = [pose for pose in poses if self._tree.take(pose, now)]
        # Without the lock, since callbacks may look up poses.
        for pose in new:
            for listener in self._listeners.get(pose.child, ()):
                if listener.is_due(pose.stamp):
                    listener.callback()

    def _on_static(self, message):
        with self._lock:
            for transform in message.transforms:
                self._tree.take_static(StampedPose.of(transform), self._now())
