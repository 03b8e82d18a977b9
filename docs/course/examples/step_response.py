"""Steps the reference of a hovering vehicle along x, and says how the vehicle follows."""

import argparse

import numpy as np

from crazyflie_reports.flight_operator import FlightOperator
from crazyflie_utils.main import begin

HEIGHT = 1.0
DURATION = 5.0


def judge(times: np.ndarray, x: np.ndarray, tilts: np.ndarray, size: float) -> str:
    """Put a step response into words.

    Parameters
    ----------
    times, x : ndarray, shape (n,)
        Since the step, s; position along it, m, at first 0.
    tilts : ndarray, shape (m,)
        Roll or pitch that was commanded, rad.
    size : float
        Of the step, m.
    """
    share = x / size
    rise = f"after {times[np.argmax(share > 0.9)]:.1f} s" if share.max() > 0.9 else "never"
    outside = times[np.abs(share - 1.0) > 0.05]
    settled = f"after {outside[-1]:.1f} s" if outside[-1] < times[-1] else "never"
    return (
        f"90 % {rise}, within 5 % {settled}, "
        f"overshoot {max(0.0, share.max() - 1.0):.0%}, "
        f"largest tilt {np.degrees(np.abs(tilts).max()):.0f} degrees"
    )


def main() -> None:
    """Fly a step from (0, 0, 1), and print how it went."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=float, default=0.5, help="of the step, m")
    size = parser.parse_args().size
    operator = FlightOperator(begin("step_response"))
    operator.wait_until_ready()
    for x in (0.0, size):
        operator.hover(DURATION)
        operator.refer_to((x, 0.0, HEIGHT))
    operator.hover(DURATION)
    record = operator.finish()
    start = record.reference.last_time
    tilts = record.final_control.between(start, np.inf)[:, :2]
    after = record.state.times >= start
    times, x = record.state.times[after] - start, record.state.column("x")[after]
    print(judge(times, x, tilts, size))


if __name__ == "__main__":
    main()
