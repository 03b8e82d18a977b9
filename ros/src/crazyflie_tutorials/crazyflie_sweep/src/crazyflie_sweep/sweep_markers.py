"""What RViz shows of a sweep."""

import genpy
import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_sweep.sweeper import Sweeper

COVERED_COLOUR = ColorRGBA(0.15, 0.65, 0.35, 0.75)
UNCOVERED_COLOUR = ColorRGBA(0.75, 0.78, 0.82, 0.6)
LANE_COLOUR = ColorRGBA(0.9, 0.45, 0.05, 1.0)

_SPACING = 0.05  #: Between the points with which lanes and arcs are drawn, m.

_LINE_WIDTH = 0.015
_TEXT_SIZE = 0.2
_THICKNESS = 0.002


def markers(sweeper: Sweeper, frame: str) -> MarkerArray:
    """Return the cells on the ground, the lanes and the share that is covered."""
    coverage = sweeper.coverage
    array = []
    for name, covered, colour in (
        ("covered", True, COVERED_COLOUR),
        ("not covered", False, UNCOVERED_COLOUR),
    ):
        cells = _marker(name, Marker.CUBE_LIST, colour, frame)
        cells.scale.x, cells.scale.y = coverage.cell_size
        cells.scale.z = _THICKNESS
        cells.points = [Point(x, y, 0.0) for x, y in coverage.middles(covered)]
        if not cells.points:
            cells.action = Marker.DELETE
        array.append(cells)
    path = sweeper.lanes
    lanes = _marker("lanes", Marker.LINE_STRIP, LANE_COLOUR, frame)
    lanes.scale.x = _LINE_WIDTH
    count = max(2, int(path.length / _SPACING))
    lanes.points = [Point(*path.at(s)[0]) for s in np.linspace(0.0, path.length, count)]
    label = _marker("share", Marker.TEXT_VIEW_FACING, LANE_COLOUR, frame)
    label.scale.z = _TEXT_SIZE
    label.text = f"{coverage.share:.1%}"
    end, _ = path.at(path.length)
    label.pose.position = Point(end[0], end[1], end[2] + 2.0 * _TEXT_SIZE)
    return MarkerArray([*array, lanes, label])


def _marker(name, shape, colour, frame):
    marker = Marker(ns=name, type=shape, color=colour)
    marker.header.frame_id = frame
    # The time 0 asks for the latest transform, also after simulated time was reset.
    marker.header.stamp = genpy.Time()
    marker.pose.orientation.w = 1.0
    return marker
