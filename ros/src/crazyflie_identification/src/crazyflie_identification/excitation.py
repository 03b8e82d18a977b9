"""Small sines around hover that identify all parameters of a model."""

import math

#: Frequencies of each control, Hz: no one is a multiple of another, so that the axes differ.
_FREQUENCIES = {
    "roll": (0.73, 1.91, 3.67),
    "pitch": (0.83, 2.17, 4.13),
    "yaw_dot": (0.53, 1.37, 2.89),
    "thrust": (0.61, 1.73, 3.31),
}
#: Amplitude of each sine (rad, rad, rad/s, m/s^2). Their sums stay below 5 degrees, 60 degrees/s
#: and 1.2 m/s^2.
AMPLITUDES = {"roll": 0.028, "pitch": 0.028, "yaw_dot": 0.35, "thrust": 0.4}

#: Amplitudes (m) and periods (s) along x, y and z of the reference, whose speed identifies the
#: drag.
SWAY = ((0.4, 6.1), (0.4, 7.3), (0.15, 5.3))

RAMP = 2.0  #: Time over which the sines grow to their amplitude (s).


def controls(t: float) -> tuple[float, float, float, float]:
    """Return what is added to roll, pitch (rad), yaw_dot (rad/s) and thrust (m/s^2) at t (s)."""
    size = min(max(t / RAMP, 0.0), 1.0)
    roll, pitch, yaw_dot, thrust = (
        size
        * AMPLITUDES[name]
        * sum(math.sin(2.0 * math.pi * f * t + k) for k, f in enumerate(frequencies))
        for name, frequencies in _FREQUENCIES.items()
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
