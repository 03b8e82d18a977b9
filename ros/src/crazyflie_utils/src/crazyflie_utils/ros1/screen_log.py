"""Logging raises nothing when the disk is full or the screen is gone."""

import logging

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
