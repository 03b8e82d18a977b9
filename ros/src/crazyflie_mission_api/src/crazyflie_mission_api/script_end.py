"""The end of a script: one thread lands its vehicles, and the others command them no more."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from crazyflie_mission_api.limits import MissionError

_NOBODY = -1  #: In place of a thread, once the vehicles have been landed.


class ScriptEnd:
    """The landing at the end of a script, and the right to command its vehicles until then.

    A script ends in its own thread, or in the one that shuts ROS down: that of ``rospy.spin()``
    after Ctrl-C, or one of rospy's after ``rosnode kill``. Methods may be called from any thread;
    ``is_shut_down()`` is whether ROS shuts down.
    """

    def __init__(self, is_shut_down: Callable[[], bool]):
        self._is_shut_down = is_shut_down
        # Identifier of the thread that lands the vehicles; None until it begins.
        self._lander: int | None = None
        # Reentrant: the landing itself commands, and may shut ROS down in the same thread.
        self._landing = threading.RLock()
        self._commanding = threading.RLock()

    def run(self, land: Callable[[], None]) -> None:
        """Call ``land()``, once; if another thread has called it, wait until it returns."""
        with self._landing:
            if self._lander is not None:
                return
            # A command that is being sent is sent before the landing.
            with self._commanding:
                self._lander = threading.get_ident()
            try:
                land()
            finally:
                self._lander = _NOBODY

    def is_over(self) -> bool:
        """Return whether this thread may command no more."""
        if self._lander is None:
            return self._is_shut_down()
        return self._lander != threading.get_ident()

    @contextmanager
    def commanding(self) -> Iterator[None]:
        """Send a command in the with block, unless this thread may not: `MissionError`."""
        with self._commanding:
            if self.is_over():
                raise MissionError(
                    "the script has ended, or ROS shuts down: its vehicles land, and are not "
                    "commanded any more"
                )
            yield
