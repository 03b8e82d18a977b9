"""The nodes that launch files for safety filters name, on a fake process."""

from crazyflie_examples.disturbed_flight_nodes import DisturbanceNode, WaypointNode
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import to_vector


def test_waypoints_come_one_after_the_other():
    process = FakeProcess()
    points = [[0.0, 0.0, 1.0], [0.5, -0.5, 1.2]]
    assert process.launch(WaypointNode(), "/cf_waypoint", {"points": points, "period": 2.0})
    process.advance(6.1)
    sent = [to_vector(message.state)[:3].tolist() for message in process.published("/ref")]
    assert sent == [points[0], points[1], points[0]]


def test_a_disturbance_is_repeated():
    process = FakeProcess()
    values = [0.0, 0.1, 0.0, 0.2, 0.0, 0.0, -0.3]
    parameters = {"topics/disturbance": "/cf7/disturbance", "disturbance": values}
    assert process.launch(DisturbanceNode(), "/disturbance", parameters)
    process.advance(1.05)
    sent = [to_vector(each.disturbance).tolist() for each in process.published("/cf7/disturbance")]
    assert sent == [values] * 10
