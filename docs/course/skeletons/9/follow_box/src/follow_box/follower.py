"""The algorithm: a distance in, a speed out."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Follower:
    """Keeps a distance to what is in front: speed in proportion to the error.

    Attributes
    ----------
    distance : float
        That is kept, m.
    gain : float
        Speed for each metre of error, 1/s.
    max_speed : float
        Ahead and back, m/s.
    lost : float
        What is farther away is not followed, m.
    """

    distance: float = 0.5
    gain: float = 0.8
    max_speed: float = 0.3
    lost: float = 2.0

    def speed(self, reading: float | None) -> float:
        """Return the speed ahead, m/s.

        Parameters
        ----------
        reading : float or None
            Of the sensor in front, m. None: it is silent. Infinity: nothing is in its range;
            minus infinity: something is nearer than its range (REP 117).
        """
        raise NotImplementedError("step 1")
