"""The takeoff server on a fake process, without a filter."""

from flight_words import texts
from std_srvs.srv import EmptyRequest
from takeoff_helpers import BARE, filter_status, state

from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils.testing import FakeProcess


def launch(parameters=BARE, **changes):
    """Return a process with a server in it."""
    process = FakeProcess()
    node = TakeoffServerNode()
    assert process.launch(node, "/takeoff_server", {**parameters, **changes})
    process.node = node
    return process


def on_ground(parameters=BARE, **changes):
    """Return a process with a server that knows the vehicle on the ground."""
    process = launch(parameters, **changes)
    if "topics/state" in parameters:
        process.publish("/state", state(0.0))
    process.publish("/in_flight_filter_status", filter_status("unknown"))
    process.advance(0.02)
    assert states(process) == ["on_ground"]
    return process


def flying(parameters=BARE, **changes):
    """Return a process with a server that knows the vehicle in flight."""
    process = launch(parameters, **changes)
    process.publish("/in_flight_filter_status", filter_status("flying"))
    if "topics/state" in parameters:
        process.publish("/state", state(1.0))
    process.advance(0.02)
    assert states(process) == ["flying"]
    return process


def call(process, service):
    return process.call(service, EmptyRequest())


def thrusts(process):
    return [message.control.thrust for message in process.published("/control/takeoff")]


def states(process):
    return texts(process.published("/in_flight_flight_status"))


def toggles(process):
    return len(process.published("/in_flight"))
