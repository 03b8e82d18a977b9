"""Figures of merit of a hover flight, and their limits."""

from collections.abc import Sequence
from dataclasses import dataclass

from crazyflie_reports.flight_record import GROUND_TOLERANCE, FlightRecord

HOVER_TOLERANCE = 0.01  #: Largest distance from the hover point of a good flight, m.
HOVER_WINDOW = 5.0  #: Time before the end of the hover from which its error is taken, s.
OVERSHOOT_LIMIT = 0.1  #: How far a good flight may rise above the hover point, m.
TOUCHDOWN_LIMIT = 0.5  #: Fastest touchdown of a good flight, m/s.


@dataclass(frozen=True)
class FlightReport:
    """Figures of one flight from /takeoff to /land; NaN if it has no hover or no touchdown."""

    time_to_hover: float  #: From the call of /takeoff until it stayed within `HOVER_TOLERANCE`, s.
    overshoot: float  #: Above the hover height, m.
    #: hover_error_mean, hover_error_max: Distance from the hover point at the end of the hover, m.
    hover_error_mean: float
    hover_error_max: float
    touchdown_speed: float  #: m/s.
    final_height: float  #: m.
    final_thrust: float  #: m/s^2.

    @classmethod
    def of(
        cls, record: FlightRecord, point: Sequence[float], window: float = HOVER_WINDOW
    ) -> "FlightReport":
        """Return the report of a record with the hover point x, y, z, m.

        The hover error is that of the last ``window`` s of the hover.
        """
        mean, largest = record.hover_error(point, window)
        try:
            touchdown = record.touchdown_speed()
        except ValueError:
            touchdown = float("nan")
        return cls(
            time_to_hover=record.time_to_hover(point, HOVER_TOLERANCE),
            overshoot=record.overshoot(point),
            hover_error_mean=mean,
            hover_error_max=largest,
            touchdown_speed=touchdown,
            final_height=float(record.state.last[2]),
            final_thrust=float(record.final_control.last[3]),
        )

    def complaints(self) -> list[str]:
        """Return what was bad about the flight, a sentence each; empty for a good one."""
        checks = [
            (
                self.hover_error_max <= HOVER_TOLERANCE,
                f"it strayed {self.hover_error_max * 1000:.1f} mm from the hover point "
                f"(limit {HOVER_TOLERANCE * 1000:.0f} mm)",
            ),
            (
                self.overshoot <= OVERSHOOT_LIMIT,
                f"it rose {self.overshoot * 1000:.0f} mm above the hover point "
                f"(limit {OVERSHOOT_LIMIT * 1000:.0f} mm)",
            ),
            (
                not self.touchdown_speed > TOUCHDOWN_LIMIT,
                f"it touched down at {self.touchdown_speed:.2f} m/s "
                f"(limit {TOUCHDOWN_LIMIT:g} m/s)",
            ),
            (
                self.final_height <= GROUND_TOLERANCE,
                f"it is {self.final_height:.3f} m above the ground after landing",
            ),
            (self.final_thrust == 0.0, f"thrust is {self.final_thrust:.2f} m/s^2 after landing"),
        ]
        return [complaint for is_good, complaint in checks if not is_good]

    def table(self) -> str:
        """Return the figures as lines of text."""
        rows = [
            ("time to hover", f"{self.time_to_hover:.2f} s"),
            ("overshoot", f"{self.overshoot * 1000:.1f} mm"),
            ("hover error, mean", f"{self.hover_error_mean * 1000:.2f} mm"),
            ("hover error, maximum", f"{self.hover_error_max * 1000:.2f} mm"),
            ("touchdown speed", f"{self.touchdown_speed:.2f} m/s"),
        ]
        known = ((name, "-" if value.startswith("nan") else value) for name, value in rows)
        return "\n".join(f"{name:<22}{value:>12}" for name, value in known)
