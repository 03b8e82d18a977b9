"""Flies several vehicles of one process at the same time."""

from concurrent.futures import ThreadPoolExecutor

from crazyflie_reports.flight_operator import FlightOperator
from crazyflie_reports.flight_record import FlightRecord
from crazyflie_utils.main import ros_process


def fly(names: list[str], hover: float) -> dict[str, FlightRecord]:
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
    operators = [FlightOperator(process, f"/{name}", start=False) for name in names]
    process.start()

    try:
        with ThreadPoolExecutor(len(names)) as threads:
            records = threads.map(lambda operator: operator.fly(hover), operators)
            return dict(zip(names, records, strict=True))
    finally:
        process.stop()
