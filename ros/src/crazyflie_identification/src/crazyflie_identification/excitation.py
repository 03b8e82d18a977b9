"""Small sines around hover that identify all parameters of a model."""

import math

#: Amplitude of each sine (rad, rad, rad/s, m/s^2) and the frequencies (Hz) of roll, pitch, yaw_dot
#: and thrust. No frequency is a multiple of another, so that the axes differ. The sums stay below 5
#: degrees, 60 degrees/s and 1.2 m/s^2.
_SINES = (
    (0.028, (0.73, 1.91, 3.67)),
    (0.028, (0.83, 2.17, 4.13)),
    (0.35, (0.53, 1.37, 2.89)),
    (0.4, (0.61, 1.73, 3.31)),
)

#: Amplitudes (m) and periods (s) along x, y and z of the reference, whose speed identifies the
#: drag.
SWAY = ((0.4, 6.1), (0.4, 7.3), (0.15, 5.3))

RAMP = 2.0  #: Time over which the sines grow to their amplitude (s).


def controls(t: float) -> tuple[float, float, float, float]:
    """Return what is added to roll, pitch (rad), yaw_dot (rad/s) and thrust (m/s^2) at t (s)."""
    size = min(max(t / RAMP, 0.0), 1.0)
    roll, pitch, yaw_dot, thrust = (
        size * amplitude * sum(math.sin(2.0 * math.pi * f * t + k) for k, f in enumerate(all_f))
        for amplitude, all_f in _SINES
    )
    return roll, pitch, yaw_dot, thrust


def reference(t: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return displacement (m) and velocity (m/s) of the reference at a time, s."""
    size = min(max(t / RAMP, 0.0), 1.0)
    angles = [(a, 2.0 * math.pi / period) for a, period in SWAY]
    return (
        tuple(size * a * math.sin(w * t) for a, w in angles),
        tuple(size * a * w * math.cos(w * t) for a, w in angles),
    )
