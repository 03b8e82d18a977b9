"""Logging raises nothing when the disk is full or the screen is gone, and waits for no master."""

import contextlib
import logging

import rospy
from rospy.impl import paramserver

_NO_TOPICS = "/rosout_disable_topics_generation"

ROSOUT = "rosout"  #: The logger behind rospy.loginfo and its like.


class Shielded(logging.Handler):
    """Hands records on to another handler, and handles its errors as Python's own handlers do.

    rospy's, which writes to the screen, does not. Under roslaunch the "screen" may be a file.
    """

    def __init__(self, handler: logging.Handler) -> None:
        super().__init__(handler.level)
        self._handler = handler

    def emit(self, record: logging.LogRecord) -> None:
        """Have the other handler write a record."""
        try:
            self._handler.emit(record)
        except OSError:
            self.handleError(record)


def shield_screen_log() -> None:
    """Put a `Shielded` around each handler of rospy's logger, once."""
    logger = logging.getLogger(ROSOUT)
    for handler in list(logger.handlers):
        if not isinstance(handler, Shielded):
            logger.removeHandler(handler)
            logger.addHandler(Shielded(handler))


def log_without_master() -> None:
    """Read the parameter with which rospy leaves topics out of /rosout, once.

    rospy caches no parameter that is not set: it asked the master at each line, and waited for one
    that was frozen, in the middle of an emergency.
    """
    value = False
    # A master that has just gone is in no process's way.
    with contextlib.suppress(OSError):
        value = rospy.get_param(_NO_TOPICS, False)
    paramserver.get_param_server_cache().set(_NO_TOPICS, value)
