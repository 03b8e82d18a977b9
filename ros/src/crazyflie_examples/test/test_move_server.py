"""The route, and the node that offers it on a fake process."""

import math
from pathlib import Path

import pytest
import rospkg
from hypothesis import given
from hypothesis import strategies as st
from std_srvs.srv import EmptyRequest, EmptyResponse

from crazyflie_examples.move_server_node import DEFAULT_POINTS, POINTS, MoveServerNode
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeProcess, launch_files
from crazyflie_utils.vectors import to_vector

LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_examples")) / "launch" / "move.launch"
COORDINATE = st.floats(-100.0, 100.0) | st.integers(-100, 100)
LISTS = st.lists(st.lists(COORDINATE, min_size=3, max_size=3), min_size=1, max_size=8)


@given(LISTS)
def test_points_are_tuples_of_three_floats(points):
    assert POINTS(points) == tuple(map(tuple, points))


def test_default_points_are_points_that_begin_and_end_apart():
    assert POINTS([list(point) for point in DEFAULT_POINTS]) == DEFAULT_POINTS
    around = zip(DEFAULT_POINTS, DEFAULT_POINTS[1:] + DEFAULT_POINTS[:1], strict=True)
    assert all(math.dist(a, b) > 0.1 for a, b in around)


@pytest.fixture
def process():
    fake = FakeProcess()
    points = [[0.0, 0, 1], [0.5, -0.5, 1.2]]
    parameters = {"topics/ref": "/cf7/ref", "srv/move": "/cf7/move", "points": points}
    assert fake.launch(MoveServerNode(), "/move_server", parameters)
    return fake


def test_each_call_publishes_the_next_point_at_rest(process):
    for _ in range(3):
        process.advance(1.0)
        assert process.call("/cf7/move", EmptyRequest()) == EmptyResponse()
    references = process.published("/cf7/ref")
    assert [to_vector(reference.state).tolist() for reference in references] == [
        [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        [0.5, -0.5, 1.2, 0.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
    ]
    stamps = [reference.header.stamp.to_sec() for reference in references]
    assert stamps == pytest.approx([101.0, 102.0, 103.0])


def test_says_nothing_uncalled(process):
    process.advance(5.0)
    assert process.published("/cf7/ref") == []


def test_needs_only_the_topic():
    fake = FakeProcess()
    assert fake.launch(MoveServerNode(), "/move_server", {"topics/ref": "/ref"})
    fake.call("/move", EmptyRequest())
    assert to_vector(fake.published("/ref")[0].state)[:3].tolist() == list(DEFAULT_POINTS[0])


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        ([], ""),
        ("0 0 1", ""),
        ([[0.0, 0.0, 1.0], [0.0, 1.0]], "point 2 is [0.0, 1.0]"),
        ([[0.0, 0.0, 1.0, 0.0]], "point 1 is [0.0, 0.0, 1.0, 0.0]"),
        ([[0.0, 0.0, math.nan]], "point 1 is [0.0, 0.0, nan]"),
        ([[0.0, 0.0, "high"]], "point 1 is"),
        ([0.0, 0.0, 1.0], "point 1 is 0.0"),
        ([[0.0, 0.0, 1.0], "abc"], "point 2 is 'abc'"),
    ],
)
def test_bad_points_are_named(points, reason):
    fake = FakeProcess()
    parameters = {"topics/ref": "/ref", "points": points}
    assert not fake.launch(MoveServerNode(), "/move_server", parameters)
    [error] = fake.logged("error")
    assert "/move_server/points is" in error
    assert "expected a list of points [x, y, z]" in error
    assert reason in error


def test_the_topic_is_required():
    fake = FakeProcess()
    assert not fake.launch(MoveServerNode(), "/move_server", {})
    assert "/move_server/topics/ref is not set" in fake.logged("error")[0]


@pytest.mark.parametrize("composed", ["false", "true"])
def test_launch_file_takes_points_and_topic(composed):
    nodes, parameters = launch_files.expand(
        LAUNCH, reference_topic="/cf7/ref", points="[[1, 0, 1.5]]", composed=composed
    )
    assert ("/move_server" in nodes) == (composed == "false")
    fake = FakeProcess(parameters)
    assert fake.launch(MoveServerNode(), "/move_server"), fake.logged("error")
    fake.call("/move", EmptyRequest())
    [reference] = fake.published("/cf7/ref")
    assert to_vector(reference.state)[:3].tolist() == [1.0, 0.0, 1.5]
    listed = launch_files.composed_nodes(parameters)
    if composed == "true":
        assert NODE_CLASSES(listed) == {"move_server": MoveServerNode}


def test_launch_file_leaves_the_points_to_the_node():
    _, parameters = launch_files.expand(LAUNCH)
    assert set(parameters) & {"/move_server/points", "/move_server/topics/ref"} == {
        "/move_server/topics/ref"
    }
