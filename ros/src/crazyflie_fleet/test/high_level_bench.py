"""A `HighLevelNode` on a fake process, and what it needs: takeoff server, estimator."""

import genpy
import numpy as np
from geometry_msgs.msg import Point
from std_srvs.srv import EmptyResponse

from crazyflie_driver import srv
from crazyflie_fleet.high_level_node import HighLevelNode
from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import to_vector

TOP = "/cf1/high_level"
SECONDS = genpy.Duration.from_sec


class Bench:
    """A node, and what it meets: takeoff server, estimator."""

    def __init__(self, **parameters):
        self.process = FakeProcess()
        handle = self.process.handle("/cf1/takeoff_server")
        self.called = []
        for name in ("takeoff", "land", "emergency"):
            handle.advertise_service(name, srv.Stop, lambda _, name=name: self._answer(name))
        self.node = HighLevelNode()
        assert self.process.launch(self.node, TOP, parameters)

    def _answer(self, name):
        self.called.append(name)
        return EmptyResponse()

    def be(self, state, position=(0.0, 0.0, 1.0)):
        """Tell where the vehicle is, and its flight state."""
        self.see(position)
        status = FlightStatus(state=getattr(FlightStatus, state.upper()))
        self.process.publish("/cf1/in_flight_flight_status", status)

    def see(self, position, velocity=(0.0, 0.0, 0.0)):
        """Tell where the vehicle is."""
        state = PositionVelocityYawState(*position, *velocity, 0.0)
        self.process.publish("/cf1/state", PositionVelocityYawStateStamped(state=state))

    def call(self, service, service_type, *arguments):
        """Call one of the services."""
        return self.process.call(f"{TOP}/{service}", service_type._request_class(*arguments))

    def go_to(self, goal, yaw=0.0, duration=2.0, relative=False):
        """Call go_to."""
        return self.call("go_to", srv.GoTo, 0, relative, Point(*goal), yaw, SECONDS(duration))

    def fly(self, duration):
        """Fly a vehicle along its references, and return them."""
        for _ in range(round(duration / 0.1)):
            self.process.advance(0.1)
            if self.references():
                self.see(self.references()[-1][:3])
        return np.array(self.references())

    def references(self):
        """Return all references so far."""
        return [to_vector(message.state) for message in self.process.published("/cf1/ref")]
