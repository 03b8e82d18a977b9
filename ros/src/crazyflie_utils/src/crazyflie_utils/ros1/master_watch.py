"""A master that is started anew knows no node: nodes have to register again."""

import threading
import xmlrpc.client

import rosgraph
import rospy

from crazyflie_utils.ros1 import registering

_PERIOD = 2.0  #: How often the master is asked whether it knows this process, s.


class MasterWatch:
    """Registers this process again with a master that has forgotten it.

    Connections between nodes do without a master, so that a flight goes on when it is gone.
    """

    def __init__(self) -> None:
        self._master = rosgraph.Master(rospy.get_name())
        self._end = threading.Event()
        self._was_there = True
        self._pid: int | None = None

    def start(self) -> None:
        """Begin to watch, in a thread of its own: a master may be frozen."""
        threading.Thread(target=self._run, name="master watch", daemon=True).start()

    def stop(self) -> None:
        """End."""
        self._end.set()

    def look(self) -> None:
        """Ask the master once, and register with it if it does not know this process."""
        try:
            is_known = self._knows_this_process()
            pid = self._pid if is_known and self._pid is not None else self._master.getPid()
        except (OSError, xmlrpc.client.Error, rosgraph.MasterException):
            if self._was_there:
                rospy.logwarn("the ROS master is gone; what is connected goes on")
            self._was_there = False
            return
        self._was_there = True
        # A process that ends takes back its registrations, while this thread may still ask.
        if not is_known and not self._end.is_set() and not rospy.core.is_shutdown_requested():
            if self._pid in (None, pid):
                rospy.logwarn("the ROS master does not know this node any more; registering again")
            else:
                rospy.logwarn("the ROS master was started anew; registering with it")
            registering.register()
        self._pid = pid

    def _run(self):
        while not self._end.wait(_PERIOD):
            self.look()

    def _knows_this_process(self):
        try:
            self._master.lookupNode(rospy.get_name())
        except rosgraph.MasterError:
            return False
        return True
