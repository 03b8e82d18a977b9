"""The firmware's commands to simulated vehicles and to groups of them, with all arguments."""

import genpy
import pytest
from geometry_msgs.msg import Point
from simulated_fleet import Swarm

from crazyflie_driver import srv
from crazyflie_fleet.conversions import to_message
from crazyflie_model.planner import smooth_piece
from crazyflie_model.polynomials import at_rest
from crazyflie_utils import ServiceError

ODD, EVEN = 1, 2


def seconds(duration):
    return genpy.Duration.from_sec(duration)


class Swarm3(Swarm):
    """Three vehicles; cf1 and cf3 are in one group, cf2 is in another."""

    def __init__(self):
        super().__init__(fleet={"n": 3})
        for name, mask in (("cf1", ODD), ("cf2", EVEN), ("cf3", ODD)):
            self.call(f"/{name}/high_level/set_group_mask", srv.SetGroupMaskRequest(mask))

    def heights(self):
        return [self.position(name)[2] for name in ("cf1", "cf2", "cf3")]


@pytest.fixture
def swarm():
    return Swarm3()


def test_a_group_takes_off_goes_and_lands(swarm):
    height = srv.TakeoffRequest(ODD, 0.6, seconds(2.0))
    swarm.call("/all/high_level/takeoff", height)
    assert swarm.heights() == pytest.approx([0.6, 0.0, 0.6], abs=0.05)
    swarm.call("/cf2/high_level/takeoff", height)
    assert swarm.heights()[1] == 0.0
    before = swarm.position("cf3")
    swarm.call(
        "/all/high_level/go_to",
        srv.GoToRequest(ODD, True, Point(0.3, 0.0, 0.2), 0.0, seconds(2.0)),
    )
    swarm.process.advance(2.5)
    expected = [before[0] + 0.3, before[1], before[2] + 0.2]
    assert swarm.position("cf3") == pytest.approx(expected, abs=0.05)
    swarm.call("/all/high_level/land", srv.LandRequest(EVEN, 0.0, seconds(2.0)))
    swarm.process.advance(6.0)
    assert swarm.heights() == pytest.approx([0.8, 0.0, 0.8], abs=0.05)
    swarm.call("/all/high_level/land", srv.LandRequest(0, 0.0, seconds(2.0)))
    swarm.process.advance(6.0)
    assert swarm.heights() == pytest.approx([0.0, 0.0, 0.0], abs=0.02)


def test_a_takeoff_takes_the_time_that_it_is_given(swarm):
    # Commands are followed before the takeoff server's own time is over.
    swarm.process.call("/cf1/high_level/takeoff", srv.TakeoffRequest(0, 1.0, seconds(2.0)))
    swarm.process.advance(2.5)
    x, y, z = swarm.position("cf1")
    assert z == pytest.approx(1.0, abs=0.06)
    goal = srv.GoToRequest(0, False, Point(x + 0.5, y, 1.0), 0.0, seconds(1.4))
    swarm.process.call("/cf1/high_level/go_to", goal)
    swarm.process.advance(1.5)
    assert swarm.position("cf1") == pytest.approx((x + 0.5, y, 1.0), abs=0.1)


def test_trajectories_begin_at_the_same_moment(swarm):
    swarm.call("/all/high_level/takeoff", srv.TakeoffRequest(0, 1.0, seconds(2.0)))
    piece = smooth_piece(at_rest((0.0, 0.0, 0.0), 0.0), (0.4, 0.0, 0.3), 0.0, 3.0)
    for name in ("cf1", "cf2", "cf3"):
        upload = srv.UploadTrajectoryRequest(7, 0, [to_message(piece)])
        swarm.call(f"/{name}/high_level/upload_trajectory", upload)
    start = {name: swarm.position(name) for name in ("cf1", "cf2", "cf3")}
    request = srv.StartTrajectoryRequest(ODD, 7, 1.0, False, True)
    swarm.call("/all/start_trajectory", request)
    swarm.process.advance(1.5)
    for name, share in (("cf1", 0.5), ("cf2", 0.0), ("cf3", 0.5)):
        moved = [a - b for a, b in zip(swarm.position(name), start[name], strict=True)]
        # A controller follows a little behind.
        assert moved == pytest.approx([share * 0.4, 0.0, share * 0.3], abs=0.1)
    references = [swarm.process.published(f"/{name}/ref")[-1] for name in ("cf1", "cf3")]
    assert references[0].header.stamp == references[1].header.stamp
    assert references[0].state.x_dot == references[1].state.x_dot > 0.1


def test_vehicles_cannot_all_go_to_one_place(swarm):
    request = srv.GoToRequest(0, False, Point(0.0, 0.0, 1.0), 0.0, seconds(2.0))
    with pytest.raises(ServiceError, match="/all/high_level/go_to refused: all vehicles cannot go"):
        swarm.call("/all/high_level/go_to", request)


def test_refusals_name_the_vehicles(swarm):
    request = srv.GoToRequest(ODD, True, Point(0.0, 0.0, 0.1), 0.0, seconds(2.0))
    with pytest.raises(ServiceError, match="2 of 3 vehicles: cf1: .* on the ground.*; cf3: .*"):
        swarm.call("/all/high_level/go_to", request)
    with pytest.raises(ServiceError, match="keeps the heading 0"):
        turned = srv.GoToRequest(0, True, Point(0.0, 0.0, 0.1), 0.5, seconds(2.0))
        swarm.call("/cf1/high_level/go_to", turned)


def test_nothing_is_published_by_vehicles_that_do_not_move(swarm):
    swarm.call("/all/high_level/takeoff", srv.TakeoffRequest(0, 0.6, seconds(2.0)))
    count = len(swarm.process.published("/cf1/ref"))
    swarm.process.advance(2.0)
    assert len(swarm.process.published("/cf1/ref")) == count
