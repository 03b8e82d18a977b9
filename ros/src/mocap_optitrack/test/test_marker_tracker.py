"""Which vehicle each unlabelled marker belongs to."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from swarm_scenes import RATE, Cameras, SwapFlight, fly

from mocap_optitrack.marker_motion import MotionLimits
from mocap_optitrack.marker_tracker import MarkerTracker, MarkerVehicle

LEFT, RIGHT = (0.0, 0.5, 0.04), (0.0, -0.5, 0.04)


def of_flight(flight, **options):
    """Return a tracker of a flight's vehicles, which are named by their numbers."""
    vehicles = [MarkerVehicle(str(k), tuple(start)) for k, start in enumerate(flight.starts)]
    return MarkerTracker(vehicles, **options)


class Scene:
    """A tracker of "left" and "right", and its frames."""

    def __init__(self, **options):
        self.log = []
        self.vehicles = [MarkerVehicle("left", LEFT), MarkerVehicle("right", RIGHT)]
        self.tracker = MarkerTracker(self.vehicles, log=self.log.append, **options)
        self.frame = 0

    def show(self, duration, *points):
        """Show points for a while (s); return what was found in the last frame."""
        found = {}
        for _ in range(round(duration * RATE)):
            self.frame += 1
            found = self.tracker.update(self.frame / RATE, points)
        return found

    def move(self, begin, end, speed, *others):
        """Move a marker straight, at a speed (m/s), among others; return the last positions."""
        steps = math.ceil(math.dist(begin, end) / speed * RATE)
        found = {}
        for fraction in np.linspace(0.0, 1.0, steps + 1)[1:]:
            point = tuple(np.array(begin) + fraction * (np.array(end) - begin))
            found = self.show(1.0 / RATE, point, *others)
        return found


@pytest.fixture
def scene():
    """Return a scene whose vehicles are tracked at their start points."""
    scene = Scene()
    assert scene.show(0.6, LEFT, RIGHT) == {"left": LEFT, "right": RIGHT}
    return scene


def flights():
    """Draw a swap flight, and what its cameras see."""

    @st.composite
    def draw_one(draw):
        n = draw(st.integers(2, 6))
        flight = SwapFlight(n, spacing=draw(st.sampled_from([0.3, 0.5])))
        # A vehicle that is not tracked does not take off.
        begins = st.floats(1.2, flight.end)
        occlusion = st.tuples(st.integers(0, n - 1), begins, st.floats(0.02, 1.0))
        place = st.tuples(st.floats(-0.6, 0.6), st.floats(-0.6, 0.6), st.floats(0.4, 1.1))
        cameras = Cameras(
            seed=draw(st.integers(0, 10_000)),
            noise=draw(st.sampled_from([0.0002, 0.001])),
            dropout=draw(st.sampled_from([0.0, 0.05, 0.3])),
            occlusions=draw(st.lists(occlusion, max_size=3 * n)),
            flashes=draw(st.sampled_from([0.0, 0.2, 2.0])),
            reflections=draw(st.lists(place, max_size=3)),
        )
        return flight, cameras

    return draw_one()


@settings(max_examples=12, deadline=None)
@given(flights())
def test_no_vehicle_ever_gets_the_marker_of_another(scenario):
    flight, cameras = scenario
    score = fly(flight, cameras, of_flight(flight).update)
    assert score.swaps == 0


def test_all_that_is_seen_is_tracked_in_a_clear_view():
    flight = SwapFlight(20)
    score = fly(flight, Cameras(dropout=0.1), of_flight(flight).update)
    assert score.tracked > 0.89 * score.frames
    assert score.swaps == score.ghosts == 0


def test_two_that_cross_keep_their_names(scene):
    for k in range(1, 201):
        y = 0.5 - k / 200.0
        found = scene.show(0.01, (0.06, y, 0.04), (-0.06, -y, 0.04))
    assert (found["left"][1], found["right"][1]) == pytest.approx((-0.5, 0.5))


def test_a_short_loss_is_held(scene):
    scene.move(LEFT, (0.0, 0.5, 1.0), 1.0, RIGHT)
    assert "left" not in scene.show(0.3, RIGHT)
    assert scene.show(0.05, (0.0, 0.55, 1.1), RIGHT)["left"] == (0.0, 0.55, 1.1)
    assert scene.log == []


def test_one_that_is_lost_in_flight_is_found_on_the_ground_only(scene):
    scene.move(LEFT, (0.0, 0.5, 1.0), 1.0, RIGHT)
    scene.show(0.6, RIGHT)
    assert scene.log == ["left is lost: its marker was last seen at (0.00, 0.50, 1.00), 0.5 s ago"]
    assert "left" not in scene.show(2.0, (0.0, 0.5, 1.0), RIGHT)
    assert "left" not in scene.move((0.0, 0.5, 1.0), (0.1, 0.5, 0.05), 1.0, RIGHT)
    assert "left" not in scene.show(0.3, (0.1, 0.5, 0.05), RIGHT)
    assert scene.show(0.3, (0.1, 0.5, 0.05), RIGHT)["left"] == (0.1, 0.5, 0.05)
    assert scene.log[1:] == ["left is tracked again"]


def test_one_that_lies_elsewhere_is_put_at_its_start_point(scene):
    scene.move(LEFT, (1.0, 0.5, 1.0), 1.0, RIGHT)
    scene.show(0.6, RIGHT)
    assert "left" not in scene.show(1.0, LEFT, RIGHT)
    assert "where it was seen last" in scene.tracker.explain("left")
    assert scene.tracker.reset_lost() == ["left"]
    assert scene.show(0.1, LEFT, RIGHT)["left"] == LEFT


def test_of_two_that_are_lost_neither_gets_the_marker_of_the_other(scene):
    """Side by side they go unseen; one marker comes back between them."""
    for k in range(100):
        y, z = 0.5 - 0.004 * k, 0.04 + 0.01 * k
        scene.show(0.01, (0.0, y, z), (0.0, -y, z))
    scene.show(0.3)
    assert scene.show(0.1, (0.0, 0.05, 1.04)) == {}


def test_a_vehicle_that_was_covered_on_the_ground_is_the_same(scene):
    scene.show(30.0)
    assert scene.show(0.4, LEFT, RIGHT) == {}
    assert scene.show(0.2, LEFT, RIGHT) == {"left": LEFT, "right": RIGHT}


def test_a_reflection_that_was_there_before_is_no_vehicle(scene):
    mirror = (0.0, 0.6, 1.0)
    scene.move(LEFT, (0.0, 0.5, 1.0), 1.0, RIGHT, mirror)
    for _ in range(30):
        assert "left" not in scene.show(0.01, RIGHT, mirror)
    assert scene.show(0.05, (0.0, 0.45, 1.0), RIGHT, mirror)["left"] == (0.0, 0.45, 1.0)


def test_a_flash_is_no_vehicle(scene):
    scene.move(LEFT, (0.0, 0.5, 1.0), 1.0, RIGHT)
    scene.show(0.2, RIGHT)
    assert "left" not in scene.show(0.02, (0.0, 0.6, 1.1), RIGHT)


def test_two_markers_at_one_start_point_are_not_tracked():
    scene = Scene()
    assert scene.show(1.0, LEFT, (0.1, 0.5, 0.04), RIGHT) == {"right": RIGHT}
    assert "expected one marker that rests at its start point" in scene.tracker.explain("left")


def test_start_points_that_are_near_have_smaller_circles():
    tracker = MarkerTracker([MarkerVehicle("a", (0, 0, 0)), MarkerVehicle("b", (0.3, 0, 0))])
    for k in range(80):
        found = tracker.update(k / RATE, [(0.09, 0.0, 0.0), (0.3, 0.11, 0.0)])
    assert list(found) == ["a"]


def test_a_vehicle_whose_marker_is_never_seen_is_explained():
    scene = Scene()
    scene.show(1.0, RIGHT)
    assert scene.tracker.explain("left") == (
        "its marker has not been seen; expected one marker that rests at its start point, within "
        "0.25 m of (0.00, 0.50, 0.04), and that no other missing vehicle may have; all markers "
        "are those of other vehicles"
    )
    assert scene.tracker.explain("right") == ""


def test_a_stream_without_markers_names_the_setting():
    scene = Scene()
    assert scene.show(1.0) == {}
    assert "switch on 'Unlabeled Markers'" in scene.tracker.explain("left")


def test_points_that_are_not_finite_are_left_out(scene):
    found = scene.show(0.05, (math.nan, 0.5, 0.04), (0.0, math.inf, 0.0), LEFT, RIGHT)
    assert found == {"left": LEFT, "right": RIGHT}


def test_time_that_begins_again(scene):
    scene.frame = 0
    assert scene.show(0.4, LEFT, RIGHT) == {}
    assert scene.show(0.2, LEFT, RIGHT) == {"left": LEFT, "right": RIGHT}


def test_one_that_is_faster_than_its_limits_is_held():
    slow = MotionLimits((0.2, 0.2, 0.2), 0.5)
    tracker = MarkerTracker([MarkerVehicle("a", LEFT, slow)])
    for k in range(60):
        assert bool(tracker.update(k / RATE, [LEFT])) == (k >= 50)
    found = [tracker.update(k / RATE, [(0.03 * (k - 59), 0.5, 0.04)]) for k in range(60, 70)]
    assert not any(found)
