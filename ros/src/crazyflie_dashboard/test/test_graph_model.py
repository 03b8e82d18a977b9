"""Vehicles as a page sees them: found, stale, gone."""

import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.msg import Config
from fake_fleet import STATE, FakeFleet
from genpy.dynamic import generate_dynamic
from geometry_msgs.msg import Point, PoseStamped, Vector3
from rosgraph_msgs.msg import Log
from std_msgs.msg import ColorRGBA, Float32, String
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_dashboard.discovery import Graph
from crazyflie_dashboard.snapshot import Placed
from crazyflie_msgs.msg import (
    ControlStamped,
    FlightStatus,
    PositionVelocityYawStateStamped,
    VehicleStatus,
)
from crazyflie_takeoff.envelope import Box
from crazyflie_utils.tf.frame_tree import StampedPose, encode_poses


@pytest.fixture
def fleet():
    found = FakeFleet()
    found.find()
    return found


def test_vehicles_are_where_their_frames_are(fleet):
    assert list(fleet.vehicles) == ["cf1", "cf2", "cf3"]
    assert fleet.vehicles["cf3"].position == (2.0, 0.0, 1.0)
    assert not fleet.vehicles["cf3"].is_stale
    assert fleet.dashboard.scene().fixed_frame == "world"


def test_states_are_words_with_their_reason(fleet):
    fleet.report("cf1", FlightStatus.LANDING, "no state for 0.5 s")
    vehicle = fleet.vehicles["cf1"]
    assert (vehicle.state, vehicle.reason) == ("landing", "no state for 0.5 s")
    assert vehicle.is_in_flight
    assert not fleet.vehicles["cf2"].is_in_flight


def test_why_a_takeoff_is_refused_is_reported_on_the_ground(fleet):
    fleet.report("cf1", FlightStatus.ON_GROUND, takeoff_refusal="the battery is low")
    assert fleet.vehicles["cf1"].reason == "the battery is low"
    fleet.report("cf1", FlightStatus.FLYING, takeoff_refusal="the vehicle is in flight")
    assert fleet.vehicles["cf1"].reason == ""


def test_one_of_three_is_stale(fleet):
    for _ in range(20):
        fleet.send_poses(["cf1", "cf2"])
    assert [name for name, each in fleet.vehicles.items() if each.is_stale] == ["cf3"]
    assert fleet.vehicles["cf3"].pose_age == pytest.approx(1.0, abs=0.2)
    assert fleet.vehicles["cf3"].position == (2.0, 0.0, 1.0)


def test_vehicles_come_and_go(fleet):
    fleet.graph = Graph({k: v for k, v in fleet.graph.topics.items() if "cf2" not in k})
    fleet.process.advance(5.0)
    assert fleet.vehicles["cf2"].is_stale
    fleet.process.advance(40.0)
    assert list(fleet.vehicles) == ["cf1", "cf3"]


def test_a_master_that_does_not_answer_leaves_the_vehicles_there(fleet):
    fleet.graph = None  # `vehicles` would raise: as an answer that cannot be read.
    read = fleet.master.graph
    fleet.master.graph = lambda: (_ for _ in ()).throw(OSError("no master"))
    fleet.process.advance(5.0)
    assert list(fleet.vehicles) == ["cf1", "cf2", "cf3"]
    assert any("no master" in text for text in fleet.process.logged("warn"))
    fleet.master.graph = read


def test_nothing_is_received_without_a_page():
    fleet = FakeFleet()
    fleet.find()
    assert fleet.process.transport.subscribers["/tf"]
    fleet.dashboard.pages.close(fleet.page)
    subscribers = fleet.process.transport.subscribers
    # A page that is loaded again finds what was there.
    fleet.process.advance(9.0)
    assert list(fleet.vehicles) == ["cf1", "cf2", "cf3"]
    fleet.process.advance(1.1)
    assert [topic for topic, each in subscribers.items() if each] == ["/clock"]
    fleet.page = fleet.dashboard.pages.open(fleet.texts.append)
    fleet.find()
    assert list(fleet.vehicles) == ["cf1", "cf2", "cf3"]


def test_states_are_received_of_watched_vehicles_only(fleet):
    def states():
        subscribers = fleet.process.transport.subscribers
        return [name for name in fleet.names if subscribers.get(f"/{name}/state")]

    assert states() == []
    fleet.dashboard.watch(fleet.page, ["cf2"])
    assert states() == ["cf2"]
    fleet.dashboard.watch(fleet.page, ["cf1"])
    assert states() == ["cf1"]
    fleet.dashboard.pages.close(fleet.page)
    assert states() == []


@pytest.mark.parametrize(("count", "received"), [(3, 3), (11, 1)])
def test_the_age_of_the_control_is_that_of_few_vehicles_and_of_watched_ones(count, received):
    fleet = FakeFleet(count)
    topics = {f"/{name}/control/final": ControlStamped._type for name in fleet.names}
    fleet.graph = Graph({**fleet.graph.topics, **topics}, services=fleet.graph.services)
    fleet.find()
    fleet.dashboard.watch(fleet.page, ["cf2"])
    for topic in topics.keys() & fleet.process.transport.subscribers.keys():
        fleet.process.publish(topic, ControlStamped())
    fleet.process.advance(0.4)
    ages = {name: each.control_age for name, each in fleet.vehicles.items()}
    assert ages["cf2"] == pytest.approx(0.4, abs=0.06)
    assert sum(age is not None for age in ages.values()) == received


def test_diagnostics_are_sentences_and_the_log_has_levels(fleet):
    status = [
        DiagnosticStatus(DiagnosticStatus.WARN, "driver: cf2", "battery low", "", []),
        DiagnosticStatus(DiagnosticStatus.ERROR, "driver: cf1", "link lost", "", []),
        DiagnosticStatus(DiagnosticStatus.OK, "driver: cf3", "connected", "", []),
    ]
    fleet.process.publish("/diagnostics", DiagnosticArray(status=status))
    fleet.process.publish("/rosout_agg", Log(level=Log.WARN, name="/a", msg="/a: <script>alert(1)"))
    fleet.process.advance(0.05)
    scene = fleet.dashboard.scene()
    assert [(each.level, each.text) for each in scene.sentences] == [
        ("error", "link lost"),
        ("warn", "battery low"),
    ]
    (line,) = scene.log
    assert (line.level, line.node, line.text) == ("warn", "/a", "<script>alert(1)")
    fleet.process.advance(11.0)
    assert fleet.dashboard.scene().sentences == ()


def test_a_vehicle_whose_fence_is_not_certain_says_so(fleet):
    """On its card, as long as it has nothing else to say."""
    name, text = "cf2/geofence: certificate", "the box is not certain: disturbance along x"
    for level in (DiagnosticStatus.WARN, DiagnosticStatus.OK):
        status = [DiagnosticStatus(level, name, text, "", [])]
        fleet.process.publish("/diagnostics", DiagnosticArray(status=status))
        fleet.process.advance(0.05)
        said = [each.reason == text for each in fleet.dashboard.scene().vehicles.values()]
        assert said == [False, level == DiagnosticStatus.WARN, False]


def test_a_scene_looks_at_each_diagnostic_as_often_as_with_one_vehicle():
    """For each vehicle of a hundred, with three diagnostics each, took 6 % of a core."""
    counts = []
    for count in (1, 5):
        looked = []

        class Seen:
            name, message = "cf1/state_estimator", ""
            level = property(lambda self, looked=looked: looked.append(self) or 0)

        fleet = FakeFleet(count)
        fleet.find()
        fleet.dashboard._model._diagnostics.take(DiagnosticArray(status=[Seen()]))
        fleet.process.advance(0.05)
        counts.append(len(looked))
    assert counts[0] == counts[1] > 0


def test_without_frames_poses_come_from_the_topics_of_a_vehicle(fleet):
    fleet.graph = Graph({"/bird/pose": "geometry_msgs/PoseStamped"})
    fleet.process.advance(8.0)
    message = PoseStamped()
    message.pose.position.z = 0.7
    message.pose.orientation.w = 1.0
    fleet.process.publish("/bird/pose", message)
    fleet.process.advance(0.05)
    assert fleet.vehicles["bird"].position == pytest.approx((0.0, 0.0, 0.7))
    assert not fleet.vehicles["bird"].is_stale


BOX = {f"box/{side}/{axis}": x for side, x in (("min", -1.0), ("max", 2.0)) for axis in "xyz"}


def add_topic(fleet, topic, kind):
    """Add a topic to the dashboard's graph."""
    fleet.graph = Graph({**fleet.graph.topics, topic: kind}, services=fleet.graph.services)
    fleet.process.advance(2.1)


def test_geofences_are_drawn_as_long_as_they_are_there(fleet):
    for name in ("cf1", "cf2"):
        topic = f"/{name}/geofence/parameter_updates"
        add_topic(fleet, topic, Config._type)
        fleet.process.publish(topic, encode_config({**BOX, "margin": 0.5}))
    fleet.process.advance(0.05)
    assert fleet.dashboard.scene().fences == (Placed(Box((-1.0,) * 3, (2.0,) * 3)),)
    assert len(fleet.process.transport.subscribers[topic]) == 1
    fleet.process.publish(topic, encode_config({"box/max/x": 3.0}))
    fleet.process.advance(0.05)
    assert fleet.dashboard.scene().fences[1] == Placed(Box((-14.0,) * 3, (3.0, 14.0, 14.0)))
    topics = {k: v for k, v in fleet.graph.topics.items() if k != topic}
    fleet.graph = Graph(topics, services=fleet.graph.services)
    fleet.process.advance(2.1)
    assert fleet.dashboard.scene().fences == (Placed(Box((-1.0,) * 3, (2.0,) * 3)),)


def test_geofences_are_drawn_where_the_frame_of_their_vehicles_is():
    fleet, topic, half = FakeFleet(), "/cf1/geofence/parameter_updates", math.sqrt(0.5)
    fleet.process.advance(0.1)
    stamp = fleet.process.clock.nanoseconds()
    above = StampedPose("map", "world", stamp, (5.0, 0.0, 0.0), (0.0, 0.0, half, half))
    # The body of motion capture moves, and the vehicle's own frame is fixed to it.
    own = StampedPose("body", "cf1", stamp, (0.0, 0.0, -0.02), (0.0, 0.0, 0.0, 1.0))
    fleet.process.publish("/tf_static", encode_poses([above, own]))
    places = {"body": (0.5, 0.0, 1.0), "cf2": (1.0, 0.0, 1.0)}
    fleet.send_poses(places=places)
    add_topic(fleet, topic, Config._type)
    fleet.process.publish(topic, encode_config(BOX))
    fleet.send_poses(places=places)
    scene = fleet.dashboard.scene()
    assert scene.fixed_frame == "map"
    assert scene.vehicles["cf1"].position == pytest.approx((5.0, 0.5, 0.98))
    (fence,) = scene.fences
    assert fence[:2] == (Box((-1.0,) * 3, (2.0,) * 3), pytest.approx((5.0, 0.0, 0.0)))
    assert fence.rotation == pytest.approx((0.0, 0.0, half, half))


@pytest.mark.parametrize("topic", ["/sweep/markers", "/cf1/high_level/plan/markers"])
def test_lines_of_markers_are_planned_paths(fleet, topic):
    add_topic(fleet, topic, MarkerArray._type)
    points = [Point(0.0, 0.0, 1.0), Point(1.0, 0.0, 1.0), Point(float("nan"), 0.0, 1.0)]
    lanes = Marker(ns="lanes", type=Marker.LINE_STRIP, points=points)
    lanes.header.frame_id = "world"
    fleet.process.publish(topic, MarkerArray([lanes]))
    fleet.process.advance(0.05)
    (path,) = fleet.dashboard.scene().paths.values()
    assert path == ((0.0, 0.0, 1.0), (1.0, 0.0, 1.0))
    fleet.process.publish(topic, MarkerArray([]))
    fleet.process.advance(0.05)
    assert fleet.dashboard.scene().paths == {}


def test_paths_of_planners_are_in_the_fixed_frame(fleet, monkeypatch):
    # The type may be installed where its publisher is, and is not needed here.
    text = "Header header\ngeometry_msgs/PoseStamped[] poses\n" + 80 * "="
    text += f"\nMSG: geometry_msgs/PoseStamped\n{PoseStamped._full_text}"
    kind = generate_dynamic("nav_msgs/Path", text)["nav_msgs/Path"]
    monkeypatch.setattr("roslib.message.get_message_class", lambda name: kind)
    add_topic(fleet, "/planner/plan", "nav_msgs/Path")
    plan = kind(poses=[PoseStamped(), PoseStamped()])
    plan.header.frame_id = "cf3"
    plan.poses[1].pose.position.y = 0.5
    fleet.process.publish("/planner/plan", plan)
    fleet.send_poses()
    assert fleet.dashboard.scene().paths["/planner/plan"] == ((2.0, 0.0, 1.0), (2.0, 0.5, 1.0))


def test_the_frame_of_a_vehicle_without_a_name_is_its_own_on_the_ground_too():
    fleet = FakeFleet(0)
    fleet.graph = Graph({"/state": "crazyflie_msgs/PositionVelocityYawStateStamped"})
    fleet.process.advance(0.1)
    fleet.send_poses(["crazyflie"], z=0.0)
    fleet.process.advance(2.1)
    fleet.send_poses(["crazyflie"], z=0.0)
    assert fleet.vehicles["/"].frame == "crazyflie"
    assert fleet.dashboard.scene().frames == ()


@pytest.mark.parametrize("rotation", [(0.0,) * 4, (math.nan, 0.0, 0.0, 1.0)])
def test_an_invalid_pose_makes_only_its_own_vehicle_old(rotation):
    fleet = FakeFleet()
    fleet.find()
    for _ in range(12):
        fleet.stamp = fleet.process.clock.nanoseconds()
        bad = StampedPose("world", "cf1", fleet.stamp, (0.0, 0.0, 1.0), rotation)
        fleet.process.publish("/tf", encode_poses([bad]))
        fleet.send_poses(["cf2", "cf3"], z=2.0)
    assert [each.is_stale for each in fleet.vehicles.values()] == [True, False, False]
    assert fleet.vehicles["cf3"].position[2] == 2.0
    (sentence,) = [each for each in fleet.dashboard.scene().sentences if "cf1" in each.text]
    assert (sentence.level, sentence.source) == ("error", "dashboard")


@pytest.mark.parametrize(
    ("offset", "text"), [(3.0, "is stamped in the future"), (-3.0, "s after their stamps")]
)
def test_clocks_that_are_not_set_alike_are_reported(fleet, offset, text):
    for _ in range(5):
        stamp = fleet.process.clock.nanoseconds() + round(offset * 1e9)
        pose = StampedPose("world", "cf2", stamp, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
        fleet.process.publish("/tf", encode_poses([pose]))
        fleet.process.advance(0.05)
    (sentence,) = [each for each in fleet.dashboard.scene().sentences if text in each.text]
    assert "cf2" in sentence.text
    assert "set the clocks of both computers" in sentence.remedy


def test_vehicles_that_a_fleet_holds_are_marked(fleet):
    add_topic(fleet, "/fleet/waiting", "std_msgs/String")
    fleet.process.publish("/fleet/waiting", String("cf1 cf3"))
    fleet.process.advance(0.05)
    assert [each.is_held for each in fleet.vehicles.values()] == [True, False, True]
    fleet.process.publish("/fleet/waiting", String(""))
    fleet.process.advance(0.05)
    assert not any(each.is_held for each in fleet.vehicles.values())


def test_a_heading_that_is_infinite_marks_its_own_vehicle_and_no_other(fleet):
    topics = {**fleet.graph.topics, "/bird/state": STATE}
    fleet.graph = Graph(topics, topics, fleet.graph.services)
    fleet.process.advance(8.0)
    message = PositionVelocityYawStateStamped()
    message.state.yaw = math.inf
    fleet.process.publish("/bird/state", message)
    fleet.send_poses()
    assert fleet.vehicles["bird"].state == "cannot be shown"
    assert fleet.vehicles["bird"].is_stale
    assert not fleet.vehicles["cf3"].is_stale


def test_a_master_that_does_not_answer_is_reported_until_it_does():
    fleet = FakeFleet()
    fleet.find()
    known = fleet.graph
    del fleet.graph
    fleet.process.advance(4.1)
    (sentence,) = fleet.dashboard.scene().sentences
    assert sentence.text.startswith("no graph: ")
    fleet.graph = known
    fleet.process.advance(4.1)
    assert fleet.dashboard.scene().sentences == ()


def test_markers_are_drawn_up_to_a_number_and_made_once(fleet):
    add_topic(fleet, "/world/markers", MarkerArray._type)
    cube = Marker(type=Marker.CUBE)
    cube.header.frame_id = "world"
    cube.pose.orientation.w = 1.0
    cube.color.a = 1.0
    moving = Marker(type=Marker.SPHERE)
    moving.header.frame_id = "cf3"
    fleet.process.publish("/world/markers", MarkerArray([moving, *(100_100 * [cube])]))
    made = []
    for k in range(20):
        fleet.send_poses(places={"cf1": (0.0, 0.0, 1.0), "cf3": (2.0, 0.0, 0.1 * k)})
        made.append([each.what for each in fleet.dashboard.scene().solids])
    assert made == 20 * [made[0]]
    scene = fleet.dashboard.scene()
    ball, cubes = scene.solids
    assert (ball.what.shape, ball.position[2]) == ("ball", pytest.approx(1.9))
    assert (cubes.what.shape, len(cubes.what.rows)) == ("box", 99_999)
    (sentence,) = [each for each in scene.sentences if "markers" in each.text]
    assert sentence.text == "100101 markers and points on /world/markers; 100000 are drawn"


def listed(fleet, kind, points, **details):
    add_topic(fleet, "/world/markers", MarkerArray._type)
    marker = Marker(type=kind, points=[Point(*each) for each in points], **details)
    marker.header.frame_id = "world"
    marker.pose.orientation.z = 1.0
    marker.pose.position.x = 1.0
    fleet.process.publish("/world/markers", MarkerArray([marker]))
    fleet.process.advance(0.05)
    return fleet.dashboard.scene().solids


def test_lists_of_markers_are_one_thing_each(fleet):
    bad = (math.nan, 0.0, 0.0)
    size = Vector3(0.1, 0.2, 0.3)
    colours = [ColorRGBA(1.0, 0.0, 0.0, 0.5), ColorRGBA(), ColorRGBA(0.0, 2.0, 0.2, 0.5)]
    rows = ((0.5, 0.0, 0.0), bad, (0.0, 0.5, 1.0))
    ((cubes, *_),) = listed(fleet, Marker.CUBE_LIST, rows, scale=size, colors=colours)
    # The marker turns them half about z.
    expected = [
        [0.5, 0.0, 0.0, 0, 0, 1, 0, 0.1, 0.2, 0.3],
        [1.0, -0.5, 1.0, 0, 0, 1, 0, 0.1, 0.2, 0.3],
    ]
    assert cubes.rows == pytest.approx(np.array(expected), abs=1e-6)
    assert cubes.colours.tolist() == [[255, 0, 0], [0, 255, 51]]
    assert cubes.opacity == 0.5
    ((points, *_),) = listed(fleet, Marker.POINTS, 100_000 * [(0.0, 0.0, 1.0)], scale=size)
    assert (points.shape, points.rows.shape, points.width) == ("points", (100_000, 3), 0.1)
    ((lines, *_),) = listed(fleet, Marker.LINE_LIST, (*rows[::2], rows[0], bad, rows[0]))
    assert lines.rows == pytest.approx(np.array([[0.5, 0.0, 0.0], [1.0, -0.5, 1.0]]), abs=1e-6)
    assert listed(fleet, Marker.SPHERE_LIST, [bad]) == ()


def test_a_voltage_that_was_known_stays_until_another_one_comes():
    fleet = FakeFleet(1)
    topics = {"/cf1/vehicle_status": VehicleStatus._type, "/cf1/battery": Float32._type}
    fleet.graph = Graph({**fleet.graph.topics, **topics}, services=fleet.graph.services)
    fleet.find()
    shown = []
    for topic, message in (
        ("/cf1/battery", Float32(3.5)),
        ("/cf1/vehicle_status", VehicleStatus(battery_voltage=4.0, link_quality=math.nan)),
        ("/cf1/vehicle_status", VehicleStatus(battery_voltage=math.nan, link_quality=0.5)),
        ("/cf1/vehicle_status", VehicleStatus(battery_voltage=0.0, link_quality=0.5)),
    ):
        fleet.process.publish(topic, message)
        fleet.process.advance(0.05)
        shown.append((fleet.vehicles["cf1"].battery, fleet.vehicles["cf1"].link_quality))
    assert shown == [(3.5, None), (4.0, None), (4.0, 0.5), (4.0, 0.5)]
