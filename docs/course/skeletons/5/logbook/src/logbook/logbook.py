"""The algorithm: a book into which flights are written."""

import math
from dataclasses import dataclass

from crazyflie_utils.refusal import RefusalError


@dataclass
class FlightEntry:
    """One flight.

    Attributes
    ----------
    number : int
        The first one is 1.
    duration : float
        s.
    distance : float
        Length of the path, m.
    max_height : float
        m.
    """

    number: int
    duration: float = 0.0
    distance: float = 0.0
    max_height: float = 0.0


class Logbook:
    """Writes down one flight after the other.

    Attributes
    ----------
    flights : list of FlightEntry
        Those that have ended.
    """

    def __init__(self) -> None:
        self.flights: list[FlightEntry] = []
        self._entry: FlightEntry | None = None

    def begin(self, time: float) -> None:
        """Begin a flight at ``time`` (s), unless one goes on."""
        raise NotImplementedError("step 3")

    def add(self, position: tuple[float, float, float]) -> None:
        """Take the next position (x, y, z), m, of the flight that goes on."""
        raise NotImplementedError("step 4")

    def end(self, time: float) -> FlightEntry | None:
        """End the flight at ``time`` (s); return it, or None if there was none."""
        raise NotImplementedError("step 5")

    def flight(self, number: int) -> FlightEntry:
        """Return a flight that has ended.

        Raises
        ------
        RefusalError
            No flight has this number. The text is "there is no flight 7; 1 have ended".
        """
        raise NotImplementedError("step 6")
