"""Step 5: does a range sensor work? The algorithm of the check."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Reading:
    """Measurements of a sensor.

    Attributes
    ----------
    time : float
        When it came, s.
    distance : float
        m; infinity where nothing is.
    """

    time: float
    distance: float


def faults(readings: list[Reading], min_range: float, max_range: float, rate: float) -> list[str]:
    """Return the faults in the readings of 2 s; an empty list if the sensor works.

    Of these texts, those that apply, in this order:

    * "silent": there are fewer than 2 readings; no other text then;
    * "too slow": there are fewer than 80 % of what ``rate`` (Hz) makes in 2 s;
    * "out of range": a finite reading is below ``min_range`` or above ``max_range`` (m), or one is
      not a number (nan);
    * "stuck": all readings are finite, and equal to the last digit. A sensor that works has noise.
    """
    if len(readings) < 2:
        return ["silent"]
    found = []
    if len(readings) < 0.8 * 2.0 * rate:
        found.append("too slow")
    distances = [reading.distance for reading in readings]
    finite = [each for each in distances if math.isfinite(each)]
    if any(map(math.isnan, distances)) or any(not min_range <= d <= max_range for d in finite):
        found.append("out of range")
    if len(finite) == len(distances) and len(set(finite)) == 1:
        found.append("stuck")
    return found
