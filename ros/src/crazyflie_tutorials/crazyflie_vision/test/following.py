"""A vehicle that takes off by itself and follows something on a known path."""

from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import PointStamped, PoseStamped
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo

from crazyflie_msgs.msg import FlightStatus
from crazyflie_reports.flight_operator import ready_operator
from crazyflie_utils.testing import peer


@dataclass
class Flight:
    """Quality of a flight.

    Attributes
    ----------
    gaps : ndarray
        Between two targets that were seen, s.
    pixel_errors : ndarray
        From the middle of the image to the target.
    distance_errors : ndarray
        Errors of the distance, between vehicle and target, m.
    path : ndarray, shape (n, 3)
        Where the vehicle was, m.
    height : float
        In the end, m.
    """

    gaps: NDArray[np.float64]
    pixel_errors: NDArray[np.float64]
    distance_errors: NDArray[np.float64]
    path: NDArray[np.float64]
    height: float


def fly(target, begin, end):
    """Follow ``target`` on its path until ``end`` (s), land, and judge from ``begin`` on."""
    with (
        peer.listening("/in_flight_flight_status", FlightStatus) as states,
        peer.listening("/target", PointStamped) as targets,
        peer.listening(f"/world/{target}/pose", PoseStamped) as poses,
        peer.listening("/camera/camera_info", CameraInfo) as infos,
        ready_operator() as operator,
    ):
        peer.wait_until(
            lambda: any(status.state == FlightStatus.FLYING for status in states.drain()),
            "the takeoff",
            limit=90.0,
        )
        for _ in range(round(end)):
            # In parts, each of which may take its time on a busy machine.
            operator.hover(1.0)
        operator.land()
        record = operator.finish()
        seen, there, info = _table(targets.drain()), _table(poses.drain()), infos.next()
    until = record.events["land"]
    seen = seen[(seen[:, 0] > until - end + begin) & (seen[:, 0] < until)]
    times = record.state.times
    judged = (times > until - end + begin) & (times < until)
    path = record.state.values[judged, :3]
    place = np.array([np.interp(times[judged], there[:, 0], there[:, k]) for k in (1, 2, 3)]).T
    return Flight(
        np.diff(seen[:, 0]),
        np.hypot(seen[:, 1] - info.K[2], seen[:, 2] - info.K[5]),
        np.abs(np.linalg.norm(path - place, axis=1) - 1.0),
        path,
        record.state.last[2],
    )


def _table(messages):
    # Rows (time, x, y, z) of points or poses.
    points = [getattr(each, "point", None) or each.pose.position for each in messages]
    stamps = [each.header.stamp.to_sec() for each in messages]
    return np.array([(t, p.x, p.y, p.z) for t, p in zip(stamps, points, strict=True)])
