"""A master that is started anew knows nobody: nodes have to tell it of themselves again."""

import threading
import xmlrpc.client

import rosgraph
import rospy

from crazyflie_utils.runtime import rospy_internals

_PERIOD = 2.0
"""How often the master is asked whether it knows this process, s."""


class MasterWatch:
    """Registers this process again with a master that has forgotten it.

    Connections between nodes do without a master, so that a flight goes on when it is gone.
    """

    def __init__(self) -> None:
        self._master = rosgraph.Master(rospy.get_name())
        self._end = threading.Event()

    def start(self) -> None:
        """Begin to watch, in a thread of its own: a master may be frozen."""
        threading.Thread(target=self._run, name="master watch", daemon=True).start()

    def stop(self) -> None:
        """End."""
        self._end.set()

    def _run(self):
        was_there = True
        while not self._end.wait(_PERIOD):
            try:
                is_known = self._knows_this_process()
            except (OSError, xmlrpc.client.Error):
                if was_there:
                    rospy.logwarn("the ROS master is gone; what is connected goes on")
                was_there = False
                continue
            was_there = True
            if not is_known and not self._end.is_set():
                rospy.logwarn("the ROS master was started anew; registering with it")
                rospy_internals.register()

    def _knows_this_process(self):
        try:
            self._master.lookupNode(rospy.get_name())
        except rosgraph.MasterError:
            return False
        return True
