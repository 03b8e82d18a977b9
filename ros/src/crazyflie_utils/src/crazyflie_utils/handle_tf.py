"""A node's way to tf."""

from collections.abc import Callable

from geometry_msgs.msg import TransformStamped

from crazyflie_utils.handle_base import HandleBase
from crazyflie_utils.tf.poses import StampedPose


class TfHandle(HandleBase):
    """What a `NodeHandle` knows of tf."""

    def broadcast_transforms(self) -> Callable[[list[TransformStamped]], None]:
        """Announce to tf and return ``broadcast(list of TransformStamped)``."""
        self._process.transforms.advertise()
        return self._process.transforms.broadcast

    def listen_to_transforms(self) -> Callable[[str, str], TransformStamped]:
        """Begin to listen to tf and return ``lookup(target, source)``.

        See `Transforms.lookup` for its result and its error.
        """
        self._process.transforms.listen()
        return self._process.transforms.lookup

    def broadcast_poses(
        self, refresh: Callable[[], None] | None = None
    ) -> Callable[[list[StampedPose]], None]:
        """Announce to tf and return ``broadcast(list of StampedPose)``, which is the quicker way.

        ``refresh()`` is called before a callback of this process looks poses up: as long as
        `poses_are_heard` is false, it is early enough to broadcast then.
        """
        transforms, executor = self._process.transforms, self._process.executor
        transforms.advertise()
        if refresh is not None:
            guarded = self.guard(refresh)
            transforms.on_lookup(lambda: guarded() if executor.is_running_here else None)
        return transforms.broadcast_poses

    def poses_are_heard(self) -> bool:
        """Tell whether anybody hears of each pose that is broadcast when it is."""
        return self._process.transforms.is_heard()

    def listen_to_poses(self) -> Callable[[str, str], StampedPose]:
        """As `listen_to_transforms`, for ``lookup(target, source)`` that returns a pose."""
        self._process.transforms.listen()
        return self._process.transforms.lookup_pose

    def on_pose(self, frame: str, period: float, callback: Callable[[], None]) -> None:
        """Have ``callback()`` called as soon as tf knows a new pose of a frame.

        Of poses that come oftener than every ``period`` (s, by their stamps) only so many are
        told of.
        """
        guarded, submit = self.guard(callback), self._process.executor.submit
        self._process.transforms.on_pose(frame, period, lambda: submit(guarded))

    def rejected_transforms(self) -> dict[str, int]:
        """Return how many transforms were not taken into tf in this process, reason to number."""
        return dict(self._process.transforms.rejected)
