"""Stability margins of each control loop.

The loops are broken at the plant's input, one at a time, with the others
closed: the margins are those of one control channel.
"""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from crazyflie_lqr.design import Design, sampled
from crazyflie_lqr.models import LinearModel

FLOWN_PERIOD = 0.01  #: Period of the controls, and of the states, in the examples (s).
_RATE = "_dot"  #: Suffix of the names of rates.

_FREQUENCIES = 500

#: Gain at rest above which a loop is treated as having an integrator, in spite of rounding.
_INFINITE = 1e9


@dataclass(frozen=True)
class Margins:
    """Margins of one loop."""

    #: gain_up, gain_down: Factors by which the loop gain may grow and shrink; infinity and 0 if
    #: they may without limit.
    gain_up: float
    gain_down: float
    phase: float  #: Phase margin (rad); infinity if the loop gain is never 1.
    crossover: float  #: Frequency of the phase margin (rad/s); NaN without one.
    delay: float  #: Additional delay of the control that the loop tolerates (s); 0 if unstable.
    #: Least distance of the loop from -1, 1 / max |S| with the sensitivity S = 1 / (1 + L): 1 is a
    #: loop that amplifies no disturbance, 0 one that is not stable.
    modulus: float


def flown(
    K: NDArray[np.float64],
    states: Sequence[str],
    plant: LinearModel,
    period: float = FLOWN_PERIOD,
    delay: float = 0.0,
) -> Design:
    """Return gains and plant as the nodes close the loop.

    Poses are sampled every ``period`` (s); rates are the differences of two poses
    (`crazyflie_state_estimator.motion.FiniteDifference`); each control is held until the next,
    and acts ``delay`` (s) after its pose.

    Parameters
    ----------
    K : array of shape (u_dim, x_dim)
    states : sequence of str
        Names of the columns of K: states of the plant.
    plant : LinearModel
        What is flown; it may have states that K does not feed back, such as the attitude.
    """
    A, B = sampled(plant, period, delay)
    n = A.shape[0]
    measured = [i for i, name in enumerate(plant.states) if not name.endswith(_RATE)]
    # The last pose follows the plant's states.
    A = np.pad(A, (0, len(measured)))
    B = np.pad(B, ((0, len(measured)), (0, 0)))
    A[n + np.arange(len(measured)), measured] = 1.0
    feedback = np.zeros((K.shape[0], A.shape[0]))
    for name, gains in zip(states, K.T, strict=True):
        index = plant.states.index(name.removesuffix(_RATE))
        if name.endswith(_RATE):
            gains = gains / period
            feedback[:, n + measured.index(index)] -= gains
        feedback[:, index] += gains
    return Design(feedback, A, B, period)


def loop_response(design: Design, loop: int) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return the frequency response of one loop (of a control) broken at the plant's input.

    That is: frequencies (rad/s; for a sampled design up to half its sample rate), and at each the
    loop transfer function L of the negative feedback: unstable where L turns about -1.
    """
    system = _broken_loop(design, loop)
    speed = np.abs(design.poles)
    speed = speed[np.isfinite(speed)]
    low, high = 1e-2 * speed.min(), 1e2 * speed.max()
    if design.sample_time > 0.0:
        high = 0.99 * math.pi / design.sample_time
    frequency = np.geomspace(low, high, _FREQUENCIES)
    return frequency, control.frequency_response(system, frequency).complex.ravel()


def loop_margins(design: Design, loop: int) -> Margins:
    """Return the margins of one loop; see `loop_response`."""
    frequency, response = loop_response(design, loop)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        gains, phases, _, _, crossovers, _ = control.stability_margins(
            control.frd(response, frequency, smooth=True), returnall=True
        )
    # At rest and at half the sample rate the response is real: it may meet -1 there, too.
    for point in (1.0, -1.0) if design.sample_time > 0.0 else (0.0,):
        gain = _broken_loop(design, loop)(point, warn_infinite=False).real
        if -_INFINITE < gain < 0.0:
            gains = [*gains, -1.0 / gain]
    delays = np.radians(np.mod(phases, 360.0)) / crossovers
    worst = np.argmin(np.abs(phases)) if len(phases) else None
    is_stable = bool(design.poles.real.max() < 0.0)
    return Margins(
        gain_up=min((g for g in gains if g > 1.0), default=math.inf),
        gain_down=max((g for g in gains if g < 1.0), default=0.0),
        phase=math.inf if worst is None else math.radians(abs(phases[worst])),
        crossover=math.nan if worst is None else crossovers[worst],
        delay=min(delays, default=math.inf) if is_stable else 0.0,
        modulus=float(np.abs(1.0 + np.asarray(response)).min()) if is_stable else 0.0,
    )


def all_margins(design: Design) -> list[Margins]:
    """Return the margins of all loops, in the order of the controls."""
    return [loop_margins(design, loop) for loop in range(design.B.shape[1])]


def _broken_loop(design, loop):
    others = np.arange(design.B.shape[1]) != loop
    feedback = design.feedback
    A = design.A + design.B[:, others] @ feedback[others]
    return control.ss(A, design.B[:, [loop]], -feedback[[loop]], 0, design.sample_time)
