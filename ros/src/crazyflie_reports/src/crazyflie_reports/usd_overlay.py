"""Finds the place of a micro SD card's log in a recording by its attitudes."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_model.angles import quaternion_from_rpy, zyx_from_quaternion
from crazyflie_reports.bag_flights import Vehicle, vehicles
from crazyflie_reports.bag_log import BagLog
from crazyflie_reports.usd_log import LONGEST

PERIOD = 0.01  #: Sampling period of the attitudes that are compared (s).
LEAST_OVERLAP = 3.0  #: Shortest time that a log and a recording have in common (s).
LEAST_CORRELATION = 0.6  #: Lowest accepted correlation of roll and pitch.


@dataclass(frozen=True)
class Position:
    """Place of a log in a recording: time of the log's time 0 (s), and correlation."""

    offset: float
    correlation: float


def position(
    measured: NDArray[np.float64],
    recorded: NDArray[np.float64],
    limits: tuple[float, float] = (-math.inf, math.inf),
) -> Position | None:
    """Return the place at which roll and pitch of a log correlate best with those of a recording.

    Both have times (s), roll and pitch (rad), shape (n, 3); ``limits`` are those of the offset (s).
    None if they never overlap for `LEAST_OVERLAP`. The correlation is that of the common part, with
    both means removed from the whole; the offset is between two samples by a parabola.
    """
    a, b = (_resampled(each) for each in (recorded, measured))
    if min(len(a), len(b)) * PERIOD < LEAST_OVERLAP:
        return None
    size = len(a) + len(b) - 1

    def correlated(x, y):
        spectrum = np.fft.rfft(x, size, axis=0) * np.fft.rfft(y, size, axis=0).conj()
        return np.roll(np.fft.irfft(spectrum, size, axis=0), len(y) - 1, axis=0)

    one_a, one_b = np.ones(len(a)), np.ones(len(b))
    product = correlated(a, b).sum(axis=1)
    energies = correlated((a**2).sum(axis=1), one_b) * correlated(one_a, (b**2).sum(axis=1))
    offsets = recorded[0, 0] - measured[0, 0] + PERIOD * (np.arange(size) - (len(b) - 1))
    overlaps = np.rint(correlated(one_a, one_b)) * PERIOD >= LEAST_OVERLAP
    overlaps &= (offsets >= limits[0]) & (offsets <= limits[1])
    shares = np.where(overlaps, product / np.sqrt(np.maximum(energies, 1e-12)), -1.0)
    best = int(shares.argmax())
    shift = 0.0
    if 0 < best < size - 1 and overlaps[best - 1] and overlaps[best + 1]:
        before, middle, after = shares[best - 1 : best + 2]
        shift = 0.5 * (before - after) / min(before - 2.0 * middle + after, -1e-12)
    return Position(float(offsets[best]) + PERIOD * shift, float(shares[best]))


def _resampled(rows):
    """Return roll and pitch every `PERIOD`, without their means, shape (n, 2)."""
    # A damaged time of a bag may be years after the others.
    if not len(rows) or rows[-1, 0] - rows[0, 0] > LONGEST:
        return np.empty((0, 2))
    times = np.arange(rows[0, 0], rows[-1, 0], PERIOD)
    values = np.column_stack([np.interp(times, rows[:, 0], rows[:, k]) for k in (1, 2)])
    return values - values.mean(axis=0)


def lay_over(usd: BagLog, logs: list[BagLog]) -> bool:
    """Add the series of a log to the recording, next to the vehicle that it matches best.

    Its times become those of the recording, and it has the phases of the vehicle. A remark states
    the place; or, if nothing matches and False is returned, the reason.
    """
    own = next(vehicles(usd), None)
    found = [
        (place, log, vehicle)
        for log in logs
        for vehicle in vehicles(log)
        if own is not None and (place := position(_angles(own), _angles(vehicle))) is not None
    ]
    best = max(found, key=lambda each: each[0].correlation, default=None)
    if best is None or best[0].correlation < LEAST_CORRELATION:
        text = (
            f"no {LEAST_OVERLAP:g} s of attitudes are in both"
            if best is None
            else f"its attitude correlates with that of {best[2].name} by "
            f"{best[0].correlation:.2f}; expected at least {LEAST_CORRELATION}"
        )
        usd.remarks += [f"{usd.name} is shown by itself: {text}"] if logs else []
        return False
    place, log, vehicle = best
    name = f"{vehicle.name} {usd.name}"
    for topic, spool in usd.sources.items():
        spool.offset, spool.namespace = place.offset, name
        log.sources[f"{name}/{topic}"] = spool
    log.events.flight_states[name] = list(vehicle.flight_states)
    log.remarks += [
        f"{usd.name} is laid over {vehicle.name}: its time 0 is at {place.offset - log.start:.3f} s"
        f" of the recording, where the attitudes correlate by {place.correlation:.2f}",
        *usd.remarks,
    ]
    return True


def _angles(vehicle: Vehicle) -> NDArray[np.float64]:
    """Return times, roll and pitch of a vehicle, as far as they are finite, shape (n, 3).

    They are those of Rz(yaw) Ry(pitch) Rx(roll), which do not change with the heading: the vehicle
    may have another one than motion capture.
    """
    rows = vehicle.attitude[:, [0, 4, 5, 6]]
    times, *angles = rows[np.isfinite(rows).all(axis=1)].T
    roll, pitch, _ = zyx_from_quaternion(quaternion_from_rpy(*angles))
    return np.column_stack([times, roll, pitch])
