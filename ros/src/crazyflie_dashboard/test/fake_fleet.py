"""A dashboard on a fake process, with vehicles that are services and poses only."""

import contextlib
from concurrent.futures import Future

from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.discovery import Graph
from crazyflie_dashboard.page_data import Command
from crazyflie_driver import srv
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.fake_process import FakeProcess
from crazyflie_utils.tf.frame_tree import StampedPose, encode_poses

STATE = "crazyflie_msgs/PositionVelocityYawStateStamped"
STATUS = "in_flight_flight_status"


class Workers:
    """An executor whose work is done at once."""

    def submit(self, work, *arguments):
        done = Future()
        try:
            done.set_result(work(*arguments))
        except Exception as error:
            done.set_exception(error)
        return done

    def shutdown(self, **_):
        pass


class FakeMaster:
    """Answers with a graph, and with the parameters of a fake process."""

    def __init__(self, process, graph):
        self._get_param, self._graph = process.transport.get_param, graph
        self.values = process.transport.parameters

    def graph(self):
        return self._graph()

    def parameters(self, names):
        found = {}
        for name in names:
            with contextlib.suppress(KeyError):
                found[name] = self._get_param(name)
        return found


class FakeLane:
    """Keeps which services are to stop motors."""

    def __init__(self):
        self.stopped = []

    def stop(self, services, age):
        self.stopped.append(services)
        done = Future()
        done.set_result({})
        return done

    def close(self):
        pass


class FakeFleet:
    """Vehicles cf1, cf2, ... with high-level services, and a dashboard with one open page.

    Attributes
    ----------
    calls : list of (str, request)
        Services that were called.
    refusals : dict
        Service to what it answers.
    lane : FakeLane
    master : FakeMaster
        Its ``values`` are parameters.
    """

    def __init__(self, count=3, name="cf{}"):
        self.process = FakeProcess()
        self.names = [name.format(k + 1) for k in range(count)]
        self.calls, self.refusals, self.texts = [], {}, []
        self.lane = FakeLane()
        node = self.process.handle("/fleet")
        self._status = {}
        for each in self.names:
            for service, kind in (
                ("takeoff", srv.Takeoff),
                ("land", srv.Land),
                ("go_to", srv.GoTo),
            ):
                top = f"/{each}/high_level"
                node.advertise_service(
                    f"{top}/{service}", kind, self._answer(f"{top}/{service}", kind)
                )
        services = dict.fromkeys(self.process.transport.services, "/fleet")
        topics = {f"/{each}/state": STATE for each in self.names}
        topics |= {f"/{each}/{STATUS}": "crazyflie_msgs/FlightStatus" for each in self.names}
        self.graph = Graph(topics, topics, services)
        self.master = FakeMaster(self.process, lambda: self.graph)
        self.dashboard = Dashboard(
            self.process.handle("/dashboard"),
            self.master,
            self.lane,
            [],
            clock=self.process.clock.time,
            workers=Workers(),
        )
        self.page = self.dashboard.pages.open(self.texts.append)
        self.stamp = 0

    def _answer(self, service, kind):
        def answer(request):
            self.calls.append((service, request))
            if service in self.refusals:
                raise ServiceError(self.refusals[service])
            return kind._response_class()

        return answer

    def offer(self, service, kind):
        """Offer one more service of the fleet, and let the dashboard find it."""
        node = self.process.handle("/fleet")
        node.advertise_service(service, kind, self._answer(service, kind))
        services = {**self.graph.services, service: "/fleet"}
        self.graph = Graph(self.graph.topics, self.graph.topics, services)
        self.process.advance(2.1)

    @property
    def vehicles(self):
        return self.dashboard.scene().vehicles

    def send_poses(self, names=None, z=1.0, places=None):
        """Publish a pose of each vehicle on /tf, and let a scene be made; ``places`` by name."""
        self.stamp = self.process.clock.nanoseconds()
        places = places or {n: (float(k), 0.0, z) for k, n in enumerate(names or self.names)}
        poses = [
            StampedPose("world", name, self.stamp, place, (0.0, 0.0, 0.0, 1.0))
            for name, place in places.items()
        ]
        self.process.publish("/tf", encode_poses(poses))
        self.process.advance(0.05)

    def find(self):
        """Make the dashboard find all vehicles, with poses."""
        self.process.advance(0.1)
        self.send_poses()
        self.process.advance(2.1)
        self.send_poses()

    def fly(self, **places):
        """Put vehicles into flight, at places (m) by name."""
        for name in self.names:
            self.report(name, FlightStatus.FLYING)
        self.send_poses(places=places)

    def report(self, name, state, reason="", takeoff_refusal=""):
        """Publish the state of a flight."""
        message = FlightStatus(state=state, reason=reason, takeoff_refusal=takeoff_refusal)
        self.process.publish(f"/{name}/{STATUS}", message)
        self.process.advance(0.05)

    def command(self, action, names=None, age=0.0, **details):
        """Give a command; return its outcomes, vehicle to text."""
        clicked = self.process.clock.time() - age
        made = Command(action, tuple(self.names if names is None else names), clicked, **details)
        return self.dashboard.command(self.page, made).result(0)
