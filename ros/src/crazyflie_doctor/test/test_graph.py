"""The doctor's checks of a graph and its motion, on data."""

import dataclasses
import subprocess
import sys

import pytest
from doctor_findings import found, the_only

from crazyflie_doctor import graph, running_graph, timing
from crazyflie_doctor.graph import Graph
from crazyflie_doctor.timing import TimingRecording, Transform
from crazyflie_lqr.models import near_hover

CONTROL = ("crazyflie_msgs/ControlStamped", "e85f24c467a6496a2e0c3b92ff0fe75d")
REFERENCE = ("crazyflie_msgs/PositionVelocityStateStamped", "d7e2e75df27e542774773e0a516e76ff")

SOFT = "0 .25 0 0 1 0 0\n-.25 0 0 -1 0 0 0\n0 0 0 0 0 0 -3.5\n0 0 -1.5 0 0 -1 0\n"


PARAMETERS = {
    "/lqr_controller/topics/control": "/control/lqr",
    "/lqr_controller/topics/reference": "ref",
    "/lqr_controller/x_dim": 7,
    "/state_estimator/frames/fixed": "/world",
    "/state_estimator/frames/robot": "crazyflie",
}

WELL = Graph(
    publishers={"/ref": {"/server"}, "/control/lqr": {"/lqr"}, "/tf": {"/simulator"}},
    subscribers={"/ref": {"/lqr"}, "/control/lqr": {"/lqr", "/filter"}, "/tf": {"/estimator"}},
    services={"/takeoff": "/server"},
    parameters=PARAMETERS,
    topic_types={("/server", "/ref"): REFERENCE, ("/lqr", "/control/lqr"): CONTROL},
    service_types={"/takeoff": ("std_srvs/Empty", "d41d8cd98f00b204e9800998ecf8427e")},
    connections={
        ("/server", "/ref", "/lqr"),
        ("/lqr", "/control/lqr", "/filter"),
        ("/simulator", "/tf", "/estimator"),
    },
)


def but(**changes):
    return dataclasses.replace(WELL, **changes)


def test_a_graph_that_is_well():
    assert not found(graph.check_nodes(WELL))
    assert not found(graph.check_types(WELL, running_graph.own_md5))
    assert not found(graph.check_connections(WELL))
    assert not found(graph.check_publishers(WELL))
    assert not found(graph.check_drivers(WELL, {}))


def test_nodes_that_do_not_answer():
    silent = but(silent={"/lqr": "timed out"})
    assert the_only(graph.check_nodes(silent)) == ("error", "/lqr does not answer (timed out)")
    # It is not said again of each of its connections.
    assert not found(graph.check_connections(dataclasses.replace(silent, connections=set())))[2:]


@pytest.mark.parametrize(
    ("types", "level", "part"),
    [
        ({("/a", "/x"): (CONTROL[0], "0" * 32)}, "error", "/a publishes /x as crazyflie_msgs/Con"),
        ({("/a", "/x"): ("their_msgs/Thing", "0" * 32)}, "warn", "unknown here"),
        ({("/a", "/x"): CONTROL, ("/b", "/x"): REFERENCE}, "error", "/x has publishers of"),
    ],
)
def test_types_that_differ(types, level, part):
    found_level, text = the_only(graph.check_types(but(topic_types=types), running_graph.own_md5))
    assert found_level == level
    assert part in text


def test_services_whose_types_differ():
    types = {"/takeoff": ("std_srvs/Empty", "0" * 32)}
    level, text = the_only(graph.check_types(but(service_types=types), running_graph.own_md5))
    assert level == "error"
    assert "/server offers /takeoff" in text


def test_a_subscriber_that_is_not_connected():
    broken = but(connections=WELL.connections - {("/lqr", "/control/lqr", "/filter")})
    text = "/filter is not connected to /lqr on /control/lqr"
    assert the_only(graph.check_connections(broken)) == ("error", text)


def test_topics_without_a_publisher():
    silent = but(publishers={"/control/lqr": {"/lqr"}})
    assert found(graph.check_publishers(silent)) == [
        ("error", "/ref has no publisher, /lqr waits for it"),
        ("error", "no node publishes /tf"),
    ]


def test_an_input_that_may_be_missing():
    parameters = {"/merger/topics/prioritized_control": "/avoid"}
    waiting = Graph(parameters=parameters, subscribers={"/avoid": {"/merger"}})
    assert the_only(graph.check_publishers(waiting))[0] == "warn"


def test_two_sources():
    publishers = {**WELL.publishers, "/ref": {"/server", "/me"}, "/control/lqr": {"/lqr", "/me"}}
    assert found(graph.check_publishers(but(publishers=publishers))) == [
        ("error", "/control/lqr comes from /lqr, /me"),
        ("warn", "the reference /ref comes from /me, /server"),
    ]


@pytest.mark.parametrize(
    ("descent", "parameters"),
    [
        ("/ref_descent", {}),
        (
            "/down",
            {"/server/topics/reference": "/ref", "/server/topics/descent_reference": "/down"},
        ),
    ],
)
def test_references_beside_those_of_the_takeoff_server(descent, parameters):
    def findings(**sources):
        publishers = {**WELL.publishers, "/ref": {"/server", *sources["of"]}, descent: {"/server"}}
        publishers[descent] |= sources.get("of_descents", set())
        return found(
            graph.check_publishers(but(publishers=publishers, parameters=PARAMETERS | parameters))
        )

    assert not findings(of={"/me"})
    assert findings(of={"/me", "/you"}) == [("warn", "the reference /ref comes from /me, /you")]
    # Two takeoff servers are one too many, too.
    assert findings(of={"/other"}, of_descents={"/other"}) == [
        ("warn", "the reference /ref comes from /other, /server")
    ]


@pytest.mark.parametrize(
    ("prefix", "topic", "number", "is_found"),
    [
        ("/cf1", "external_pose", 1, True),
        ("", "external_position", 1, True),
        ("/cf1", "external_pose", 2, False),
        ("/cf1", "pose", 1, False),
    ],
)
def test_poses_for_an_estimator_that_ignores_them(prefix, topic, number, is_found):
    parameters = {f"{prefix}/stabilizer/estimator": number}
    graph_ = but(parameters=parameters, publishers={f"{prefix}/{topic}": {"/mocap"}})
    texts = [text for _, text in found(graph.check_estimators(graph_))]
    assert len(texts) == is_found
    assert all(f"ignores {prefix}/{topic}" in text for text in texts)


def test_two_drivers_of_one_vehicle():
    uri = "radio://0/80/2M"
    twice = but(parameters={"/cf1/add/uri": uri, "/cf2/add/uri": uri, "/cf3/add/uri": "udp://x:1"})
    assert found(graph.check_drivers(twice, {uri: {"/a", "/b"}, "udp://x:1": {"/a"}})) == [
        ("error", f"{uri} is flown by /a, /b"),
        ("error", f"{uri} is added by /cf1/add, /cf2/add"),
    ]


def test_two_drivers_of_one_vehicle_whose_address_is_spelled_in_two_ways():
    first, second = "radio://0/80/2M/E7E7E7E7E7", "radio://1/080/2M/e7e7e7e7e7?safelink=0"
    twice = but(parameters={"/cf1/add/uri": first, "/cf2/add/uri": second, "/cf3/add/uri": "x://?"})
    reported = {"udp://localhost:1": {"/a"}, "udp://127.0.0.1:1": {"/b"}, second: {"/a"}}
    assert found(graph.check_drivers(twice, reported)) == [
        ("error", "udp://127.0.0.1:1 is flown by /a, /b"),
        ("error", f"{first} is added by /cf1/add, /cf2/add"),
    ]


def test_addresses_are_read_without_cflib():
    program = "import sys; sys.modules['cflib'] = None; import crazyflie_doctor.graph"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


# Time, tf, delay.


def stream(child="crazyflie", parent="world", node="/mocap", period=0.01, age=0.002, count=100):
    return [
        Transform(parent, child, node, 50.0 + k * period, 50.0 + k * period + age)
        for k in range(count)
    ]


def test_motion_that_is_well(tmp_path):
    recording = TimingRecording(
        transforms=stream() + stream("crazyflie/base_link", "crazyflie", "/static", 0.1)
    )
    for check in (
        timing.check_clock,
        timing.check_tf_tree,
        timing.check_frames,
        timing.check_tf_rate,
        timing.check_gains,
    ):
        assert not found(check(WELL, recording))


@pytest.mark.parametrize(
    ("simulated", "sources", "clocks", "part"),
    [
        (True, set(), [], "nothing comes on /clock"),
        (True, {"/sim"}, [1.0, 1.0], "/clock stands still"),
        (True, {"/sim", "/bag"}, [1.0, 2.0], "/clock comes from /bag, /sim"),
        (False, {"/sim"}, [1.0, 2.0], "/sim publishes /clock, but /use_sim_time is not true"),
    ],
)
def test_clocks(simulated, sources, clocks, part):
    given = but(parameters={"/use_sim_time": simulated}, publishers={"/clock": sources})
    level, text = the_only(timing.check_clock(given, TimingRecording(clocks=clocks)))
    assert level == "error"
    assert part in text


def test_simulated_time_that_goes():
    given = but(parameters={"/use_sim_time": True}, publishers={"/clock": {"/sim"}})
    assert not found(timing.check_clock(given, TimingRecording(clocks=[1.0, 2.0])))


def test_a_node_that_lives_by_another_clock():
    level, text = the_only(timing.check_clock(WELL, TimingRecording(transforms=stream(age=1.7e9))))
    assert level == "error"
    assert "/mocap stamps transforms by another clock" in text


@pytest.mark.parametrize(
    ("transforms", "part"),
    [
        (stream() + stream(parent="map", node="/other"), "crazyflie has the parents map, world"),
        (stream() + stream(node="/other"), "transform of crazyflie comes from /mocap, /other"),
        (stream("a", "b") + stream("b", "a"), "tf has a loop: a -> b -> a"),
        (
            [Transform("a", "b", node, 0.0, 1.0, is_static=True) for node in ("/1", "/2")],
            "the static transform of b comes from /1, /2",
        ),
    ],
)
def test_no_tree(transforms, part):
    level, text = the_only(timing.check_tf_tree(WELL, TimingRecording(transforms=transforms)))
    assert level == "error"
    assert part in text


def test_frames_that_silent_publishes():
    level, text = the_only(
        timing.check_frames(WELL, TimingRecording(transforms=stream("crazyfly")))
    )
    assert level == "error"
    assert "the frame crazyflie that /state_estimator needs (did you mean crazyfly?)" in text
    apart = TimingRecording(transforms=stream("a") + stream("crazyflie", "map"))
    assert "does not connect world and crazyflie" in the_only(timing.check_frames(WELL, apart))[1]


@pytest.mark.parametrize(
    ("transforms", "level", "part"),
    [
        (stream(period=0.04), "warn", "comes at 25.0 Hz"),
        (stream(period=0.2), "error", "comes at 5.0 Hz"),
        (stream(period=0.0), "error", "stands still"),
        (stream(age=0.3), "error", "is 0.30 s old"),
        (stream(age=-8.0), "error", "is 8.00 s ahead"),
        (stream()[:40] + stream()[60:], "warn", "pauses for 0.21 s"),
    ],
)
def test_poor_poses(transforms, level, part):
    found_level, text = the_only(timing.check_tf_rate(WELL, TimingRecording(transforms=transforms)))
    assert found_level == level
    assert part in text


def test_a_constant_link_between_vehicle_and_world_may_be_slow():
    slow = stream("crazyflie", "vicon/cf7", "/static", 0.1, age=-0.1)
    recording = TimingRecording(transforms=stream("vicon/cf7") + slow)
    assert not found(timing.check_tf_rate(WELL, recording))


@pytest.mark.parametrize(
    ("used", "levels"), [(0.5, []), (0.9, ["warn"]), (1.1, ["error"])], ids=["fits", "near", "late"]
)
def test_gains_and_delay(tmp_path, used, levels):
    file = tmp_path / "K.txt"
    file.write_text(SOFT)
    margin, _ = timing.delay_margin(str(file), near_hover())
    parameters = {**PARAMETERS, "/lqr_controller/K_file": str(file)}
    # Each control is held for a period: half of it is added to the delay.
    period = 0.01
    late = used * margin - 0.5 * period
    stamps = [k * period for k in range(100)]
    recording = TimingRecording(
        delays={"/control/lqr": [late] * 100}, control_stamps={"/control/lqr": stamps}
    )
    findings = found(timing.check_gains(but(parameters=parameters), recording))
    assert [level for level, _ in findings] == levels


def test_a_gain_file_that_is_gone():
    parameters = {**PARAMETERS, "/lqr_controller/K_file": "/nowhere/K.txt"}
    recording = TimingRecording(
        delays={"/control/lqr": [0.0, 0.0]}, control_stamps={"/control/lqr": [1.0, 1.01]}
    )
    level, text = the_only(timing.check_gains(but(parameters=parameters), recording))
    assert level == "error"
    assert "cannot read /nowhere/K.txt" in text
