"""A short soak, and what its watch complains of."""

import math
from random import Random

import pytest
from geometry_msgs.msg import TransformStamped
from std_srvs.srv import EmptyRequest
from tf2_msgs.msg import TFMessage

from crazyflie_dev.soak import Soak, soak
from crazyflie_dev.soak_faults import FAULTS, LIVE_VALUES, NODES, SoakFlight, live_parameters
from crazyflie_dev.soak_watch import BLIND_LIMIT, Watch
from crazyflie_model.units import GRAVITY
from crazyflie_msgs.msg import Control, ControlStamped, FlightStatus, PositionVelocityStateStamped
from crazyflie_reports.replay import Status
from crazyflie_reports.replay_program import journals_of, replay_all
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.tf.frame_tree import StampedPose, encode_poses

POSE_PERIOD = 0.01  #: Of the simulator, s; a soak from the command line has twice as many poses.


@pytest.fixture(scope="module")
def result():
    """Return what was seen in a soak with every fault."""
    return soak(1100.0, seed=7, simulator_dt=POSE_PERIOD)


# For minutes of simulated time: a quadrotor flies a shorter soak below.
@pytest.mark.long
def test_every_fault_has_its_turn(result):
    assert set(result["faults"]) == {fault.name for fault in FAULTS}


@pytest.mark.long
def test_nothing_makes_the_vehicle_fly_away(result):
    assert result["violations"] == []
    assert result["errors logged"] == 0
    assert result["takeoffs answered, refused"][0] > 0


def test_nothing_makes_the_quadrotor_fly_away():
    assert soak(60.0, seed=8, dynamics="quadrotor", simulator_dt=POSE_PERIOD)["violations"] == []


def test_flights_by_the_page_of_a_dashboard_that_lags_and_reloads(monkeypatch):
    monkeypatch.setattr("crazyflie_dev.soak._PAGE_SHARE", 1.0)
    result = soak(60.0, seed=9, simulator_dt=POSE_PERIOD)
    assert result["flights by the page"] > 0
    assert result["violations"] == []


@pytest.mark.parametrize(
    ("dynamics", "duration"),
    [
        ("near_hover", 30.0),
        # The same for longer, with every fault and by each model.
        *(
            pytest.param(dynamics, 600.0, marks=pytest.mark.long)
            for dynamics in ("near_hover", "coupled_7d", "quadrotor")
        ),
    ],
)
def test_journals_of_what_was_killed_and_frozen_replay_to_the_bit(tmp_path, dynamics, duration):
    soak(duration, 5, journals=tmp_path, dynamics=dynamics, simulator_dt=POSE_PERIOD)
    paths = journals_of([tmp_path])
    assert len(paths) > len(NODES)
    different = [each.text for each in replay_all(paths) if each.status is not Status.IDENTICAL]
    assert different == []


def test_every_live_parameter_is_changed():
    """Also those that are added later: a soak that does not know one fails here."""
    assert set(live_parameters(Soak(seed=1, dynamics="quadrotor").graph)) == set(LIVE_VALUES)


def test_faults_of_poses_arrive():
    names = {
        "poses are not finite",
        "quaternions are not rotations",
        "poses jump",
        "stamps are 3 s old",
        "stamps are 8 s ahead",
    }
    pose = StampedPose("world", "crazyflie", 100_000_000_000, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
    message = encode_poses([pose])
    for fault in FAULTS:
        if fault.name in names:
            names.remove(fault.name)
            graph = FakeGraph({})
            steps = fault.run(SoakFlight(graph, Random(1), print))
            next(steps)
            (arrived,) = graph.faults["/tf"](message)
            assert str(arrived.transforms) != str(message.transforms), fault.name
    assert not names


@pytest.mark.parametrize("name", NODES)
def test_no_node_that_is_killed_in_hover_makes_the_thrust_jump(name):
    run = Soak(seed=1)
    graph = run.graph
    takeoff = graph.call("/takeoff", EmptyRequest())
    graph.advance(10.0)
    assert takeoff.done() and takeoff.exception() is None
    thrusts, heights = [], []
    graph.listen("/control/final", lambda message: thrusts.append(message.control.thrust))
    graph.kill(name)
    graph.advance(1.0)
    run.start(name)
    for _ in range(100):
        graph.advance(0.1)
        heights.append(run.watch.height)
    assert max(thrusts) < 1.2 * GRAVITY
    # It flies on, or has come down.
    assert heights[-1] > 0.9 or (heights[-1] < 0.01 and thrusts[-1] == 0.0)
    assert run.watch.hardest < 1.0


@pytest.mark.parametrize("dynamics", ["near_hover", "quadrotor"])
@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(2, 5))]
)
def test_nodes_that_hardly_run_do_not_make_the_vehicle_climb(dynamics, seed):
    """On a computer that is too busy, nodes run for 20 to 50 ms and stop for 100 to 600 ms.

    The filter lands, since it hardly sees the vehicle.
    """
    run = Soak(seed, dynamics=dynamics, simulator_dt=POSE_PERIOD)
    graph, random = run.graph, run.random
    takeoff = graph.call("/takeoff", EmptyRequest())
    graph.advance(10.0)
    assert takeoff.done() and takeoff.exception() is None
    run.watch.highest = -math.inf
    run.watch.allow(1.0)
    change = dict.fromkeys(NODES, graph.time)
    frozen = set()
    end = graph.time + 10.0
    while graph.time < end:
        for name in NODES:
            if graph.time < change[name]:
                continue
            if name in frozen:
                frozen.remove(name)
                graph.thaw(name)
                change[name] = graph.time + random.uniform(0.02, 0.05)
            else:
                frozen.add(name)
                graph.freeze(name)
                change[name] = graph.time + random.uniform(0.1, 0.6)
        graph.advance(0.01)
    assert run.watch.highest < 0.2
    assert run.watch.hardest < 1.0
    assert run.watch.distance < 0.5
    assert any("this computer is too busy" in text for _, text in graph.log)
    for name in frozen:
        graph.thaw(name)
    graph.advance(10.0)
    assert run.watch.height == 0.0
    assert run.watch.state == "on_ground"


@pytest.fixture
def watch():
    graph = FakeGraph({})
    watch = Watch(graph)
    watch.begin()
    return watch


def is_at(watch, height, x=0.0, after=0.01):
    watch.graph.advance(after)
    transform = TransformStamped()
    transform.transform.translation.x = x
    transform.transform.translation.z = height
    watch.graph.publish("/tf", TFMessage([transform]))


def command(watch, thrust=9.81, roll=0.0):
    watch.graph.publish("/control/final", ControlStamped(control=Control(thrust=thrust, roll=roll)))


def test_a_vehicle_that_a_filter_catches_above_its_reference_is_where_it_may_be(watch):
    watch.may_fly = watch.may_fall = True
    watch.allow(2.0)
    is_at(watch, 2.0)
    is_at(watch, 1.99)
    # It sinks at 1 m/s, and would be 0.6 m further down after 2 s.
    command(watch, thrust=GRAVITY + 0.7)
    watch.renew()
    is_at(watch, 1.98)
    assert watch.violations == []


def test_a_flight_as_it_should_be(watch):
    watch.may_fly = True
    watch.allow(1.0)
    for state in ("on_ground", "taking_off", "flying"):
        watch.graph.publish(
            "/in_flight_flight_status", FlightStatus(state=getattr(FlightStatus, state.upper()))
        )
    for height in (0.0, 0.5, 1.1):
        is_at(watch, height, after=1.0)
        command(watch)
    assert watch.violations == []
    assert watch.highest == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("reference", "is_legal"), [(None, False), (math.nan, False), (-2.0, True), (3.0, True)]
)
def test_a_vehicle_is_faster_where_a_reference_comes_in_its_motion(watch, reference, is_legal):
    watch.may_fly = True
    watch.allow(1.0)
    for x in (0.0, 0.03):
        is_at(watch, 1.0, x=x)
    if reference is not None:
        message = PositionVelocityStateStamped()
        message.state.x, message.state.z = reference, 1.0
        watch.graph.publish("/ref", message)
    # Reaching 3 m/s, or stopping, takes 1.2 m: 3.35 m/s on 3 m, 3.96 m/s on 4.2 m.
    is_at(watch, 1.0, x=-0.008)
    assert (watch.violations == []) == is_legal
    # The next flight begins from rest.
    watch.renew()
    watch.allow(1.0)
    is_at(watch, 1.0, x=-0.046)
    assert len(watch.violations) == (1 if is_legal else 2)
    assert "too fast: 3.80 m/s" in watch.violations[-1]


def test_complaints(watch):
    watch.may_fly = True
    watch.allow(1.0)
    is_at(watch, 1.3)
    is_at(watch, 1.3, x=9.0)
    command(watch, thrust=math.nan)
    command(watch, thrust=17.0)
    command(watch, roll=0.5)
    watch.graph.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.ON_GROUND))
    watch.graph.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    watch.is_blind = True
    is_at(watch, 0.5)
    is_at(watch, 0.5, after=BLIND_LIMIT + 3.5)
    is_at(watch, 0.5, after=BLIND_LIMIT + 3.5)
    is_at(watch, 0.1)
    is_at(watch, 0.05)
    is_at(watch, 0.0)
    watch.is_emergency = True
    command(watch)
    watch.may_fly = False
    command(watch, thrust=12.0)
    is_at(watch, 0.2)
    kinds = {text.split(": ")[1].split(":")[0] for text in watch.violations}
    assert kinds == {
        "too high",
        "flown away",
        "too fast",
        "control is not finite",
        "thrust out of limits",
        "tilt out of limits",
        "flight state went from on_ground to flying",
        "in the air without a pose",
        "hard landing",
        "thrust in emergency",
        "thrust without a takeoff",
        "in the air unasked",
    }


def test_a_complaint_comes_once_in_a_flight(watch):
    watch.may_fly = True
    command(watch, thrust=17.0)
    command(watch, thrust=18.0)
    assert len(watch.violations) == 1
    watch.renew()
    command(watch, thrust=17.0)
    assert len(watch.violations) == 2


def test_a_takeoff_that_is_refused_without_a_fault_is_a_violation(monkeypatch):
    """A filter that hears nothing any more does no harm, and is of no use."""
    run = Soak(seed=1)
    monkeypatch.setattr(run.random, "uniform", lambda low, high: high)
    run.graph.faults["/control/lqr"] = lambda message: []
    run.fly(next(fault for fault in FAULTS if fault.name == "the wall clock is set"))
    assert [text for text in run.watch.violations if "refused without a fault" in text]
