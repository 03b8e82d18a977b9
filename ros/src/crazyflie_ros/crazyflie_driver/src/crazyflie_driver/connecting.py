"""Connecting to a vehicle that may not be on yet."""

import time
from collections.abc import Callable

from crazyflie_link.errors import NoAnswerError

PAUSE = 0.2
"""Between two attempts, s."""


def connect_within(
    limit: float,
    connect: Callable[[], None],
    is_leaving: Callable[[], bool],
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Call ``connect()`` again and again while the vehicle does not answer; blocks.

    Parameters
    ----------
    limit : float
        Time after which no new attempt is made, s; there is always one.
    connect : callable
        Makes one attempt.
    is_leaving : callable
        Whether the vehicle is being removed, which ends the attempts.
    clock, sleep : callable
        Time, s, and how to wait for some.

    Raises
    ------
    NoAnswerError
        The vehicle has not answered within the limit.
    CrazyflieError
        Another error of an attempt, which is not repeated.
    """
    end = clock() + limit
    while True:
        try:
            return connect()
        except NoAnswerError:
            if is_leaving() or clock() >= end:
                raise
        sleep(PAUSE)
