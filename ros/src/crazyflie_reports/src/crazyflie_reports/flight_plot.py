"""A picture of a flight: height, position error and controls over time."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from crazyflie_reports.flight_record import FlightRecord


def save(record: FlightRecord, point: ArrayLike, path: Path) -> None:
    """Draw a flight, with the hover point in m, into a PNG file."""
    start = record.events["takeoff"]
    figure = Figure(figsize=(9, 10), layout="constrained")
    height, error, tilt, thrust = figure.subplots(4, 1, sharex=True)
    times = record.state.times - start
    height.plot(times, record.state.column("z"), label="height")
    if len(record.reference):
        height.step(
            np.append(record.reference.times - start, times[-1]),
            np.append(record.reference.column("z"), record.reference.column("z")[-1]),
            where="post",
            linestyle="--",
            label="reference",
        )
    height.set_ylabel("z (m)")
    height.legend(loc="center")

    error.semilogy(times, np.maximum(record.position_error(point), 1e-6))
    error.set_ylabel("distance from\nhover point (m)")

    control_times = record.final_control.times - start
    for name in ("roll", "pitch"):
        tilt.plot(control_times, np.degrees(record.final_control.column(name)), label=name)
    tilt.plot(
        control_times, np.degrees(record.final_control.column("yaw_dot")), label="yaw rate (deg/s)"
    )
    tilt.set_ylabel("attitude (deg)")
    tilt.legend(loc="upper right")
    largest = max(1.0, np.abs(tilt.get_ylim()).max())
    tilt.set_ylim(-largest, largest)

    thrust.plot(control_times, record.final_control.column("thrust"))
    thrust.set_ylabel("thrust (m/s²)")
    thrust.set_xlabel("time after /takeoff (s)")

    for axes in (height, error, tilt, thrust):
        axes.grid(alpha=0.3)
        for name, moment in record.events.items():
            axes.axvline(moment - start, color="gray", linewidth=0.8, linestyle=":")
            if axes is height:
                axes.annotate(
                    name,
                    (moment - start, 1.02),
                    xycoords=("data", "axes fraction"),
                    ha="center",
                    fontsize=9,
                    color="gray",
                )
    figure.savefig(path, dpi=110)
