"""Flies several vehicles of one process at the same time."""

from concurrent.futures import ThreadPoolExecutor

from crazyflie_dev.pilot import Pilot
from crazyflie_utils.runner import ros_process


def fly(names: list, hover: float) -> dict:
    """Take off, hover and land with all vehicles.

    Parameters
    ----------
    names : list of str
        Namespaces of the vehicles.
    hover : float
        How long, s.

    Returns
    -------
    dict of str to FlightRecord
        By name.
    """
    process = ros_process()
    pilots = [Pilot(process, f"/{name}", start=False) for name in names]
    process.start()

    def flight(pilot):
        pilot.wait_until_ready()
        pilot.takeoff()
        pilot.hover(hover)
        pilot.land()
        return pilot.finish()

    try:
        with ThreadPoolExecutor(len(names)) as threads:
            return dict(zip(names, threads.map(flight, pilots), strict=True))
    finally:
        process.stop()
