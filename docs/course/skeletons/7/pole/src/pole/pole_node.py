"""The node: the vehicle's pose from tf in, a marker and the distance out."""

import genpy
from std_msgs.msg import ColorRGBA, Float64
from typing_extensions import override
from visualization_msgs.msg import Marker

from crazyflie_utils import Node, NodeHandle, Parameters, TransformError, parameter
from crazyflie_utils.parameters.types import FRAME, Number
from pole.pole import Pole

PERIOD = 0.1
"""Between two looks at the vehicle, s."""

GREEN = ColorRGBA(0.1, 0.65, 0.3, 0.8)
RED = ColorRGBA(0.85, 0.1, 0.1, 0.8)


class PoleParameters(Parameters):
    """Parameters of `PoleNode`."""

    x: float = parameter(Number("m"), "where the pole stands", 0.0)
    y: float = parameter(Number("m"), "where the pole stands", -0.5)
    radius: float = parameter(Number("m", above=0.0), "of the pole", 0.05)
    height: float = parameter(Number("m", above=0.0), "of the pole", 1.2)
    near: float = parameter(Number("m", above=0.0), "a nearer vehicle turns it red", 0.48)
    fixed_frame: str = parameter(FRAME, "in which the pole stands", "world", "frames/fixed")
    robot_frame: str = parameter(FRAME, "of the vehicle", "crazyflie", "frames/robot")


class PoleNode(Node):
    """Look the vehicle up in tf, and show how near it is."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = p = handle.load(PoleParameters)
        self._pole = Pole(p.x, p.y, p.radius, p.height)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._markers = handle.publisher("~marker", Marker, latch=True)
        self._distances = handle.publisher("~distance", Float64)
        self._lookup = handle.listen_to_transforms()
        handle.timer(PERIOD, self._on_timer)

    def _on_timer(self):
        fixed, robot = self._parameters.fixed_frame, self._parameters.robot_frame
        try:
            transform = self._lookup(fixed, robot).transform
        except TransformError as error:
            self._handle.warn(f"no transform {fixed} -> {robot}: {error}", throttle=5.0, key="tf")
            return
        self._show(transform.translation)

    def _show(self, place):
        # Step 2: publish the distance of place, and the marker, RED when it is nearer than `near`.
        # place has the fields x, y and z; Pole.distance takes a tuple of them.
        raise NotImplementedError("step 2")

    def _marker(self, colour):
        marker = Marker(ns="pole", type=Marker.CYLINDER, color=colour)
        marker.header.frame_id = self._parameters.fixed_frame
        # The time 0: drawn where the frame is now.
        marker.header.stamp = genpy.Time()
        # Step 3: pose and scale. The origin of a cylinder is its middle; an orientation without a
        # rotation has w = 1.
        return marker
