"""How much worse each control loop may become before it is unstable.

The loops are broken at the plant's input, one at a time, with the others
closed: what is asked is how far one control channel may be off.
"""

import math
import warnings
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from crazyflie_lqr.design import Design

_FREQUENCIES = 500

_INFINITE = 1e9  #: An open integrator has at least this gain at rest, in spite of rounding.


@dataclass(frozen=True)
class Margins:
    """Margins of one loop."""

    #: gain_up, gain_down: Factors by which the loop gain may grow and shrink; infinity and 0 if
    #: they may without limit.
    gain_up: float
    gain_down: float
    phase: float  #: Phase it may lose, rad; infinity if its gain is never 1.
    crossover: float  #: Where the phase margin is, rad/s; NaN without one.
    delay: float  #: Time by which the control may be late in addition, s.


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
    return Margins(
        gain_up=min((g for g in gains if g > 1.0), default=math.inf),
        gain_down=max((g for g in gains if g < 1.0), default=0.0),
        phase=math.inf if worst is None else math.radians(abs(phases[worst])),
        crossover=math.nan if worst is None else crossovers[worst],
        delay=min(delays, default=math.inf),
    )


def _broken_loop(design, loop):
    others = np.arange(design.B.shape[1]) != loop
    feedback = design.feedback
    A = design.A + design.B[:, others] @ feedback[others]
    return control.ss(A, design.B[:, [loop]], -feedback[[loop]], 0, design.sample_time)
