"""Bad input gets a message that names method, argument, value and what was expected."""

import math

import numpy as np
import pytest
from sim import PAIR, simulated
from uav_trajectory import Polynomial4D, Trajectory

import crazyflie_py

NAN = math.nan


def trajectory(pieces=1, duration=1.0, x=(0.0, 1.0)):
    result = Trajectory()
    result.polynomials = [Polynomial4D(duration, x, [0], [0], [0])] * pieces
    result.duration = pieces * duration
    return result


@pytest.fixture(scope="module")
def swarm():
    return simulated()


WRONG = [
    (lambda s, cf: cf.takeoff(NAN, 1.0), "cf1.takeoff: targetHeight is nan; .* a finite number"),
    (lambda s, cf: cf.takeoff(1.0, -1.0), "cf1.takeoff: duration is -1.0; .* >= 0"),
    (
        lambda s, cf: cf.takeoff(1.0, 1.0, 256),
        "groupMask is 256; .* from 0 to 255",
    ),
    (lambda s, cf: s.allcfs.land(0.0, 1.0, -1), "allcfs.land: groupMask is -1; .* 0 to 255"),
    (lambda s, cf: cf.stop("a"), "cf1.stop: groupMask is 'a'; expected an integer"),
    (lambda s, cf: cf.setGroupMask(1.5), "cf1.setGroupMask: groupMask is 1.5; expected an integer"),
    (lambda s, cf: cf.goTo([1, 2], 0, 1), r"cf1.goTo: goal is \[1, 2\]; .* three finite numbers"),
    (lambda s, cf: cf.goTo(np.array([1, 2, NAN]), 0, 1), "cf1.goTo: goal is .*nan"),
    (lambda s, cf: cf.goTo(None, 0, 1), "cf1.goTo: goal is None"),
    (lambda s, cf: cf.goTo([1, 2, 3], "north", 1), "cf1.goTo: yaw is 'north'"),
    (lambda s, cf: s.allcfs.goTo([0, 0, 0], 0, NAN), "allcfs.goTo: duration is nan"),
    (lambda s, cf: cf.startTrajectory(3), "trajectoryId is 3; expected one that uploadTrajectory"),
    (lambda s, cf: s.allcfs.startTrajectory(300), "trajectoryId is 300; .* from 0 to 255"),
    (lambda s, cf: cf.startTrajectory(0, timescale=0.0), "timescale is 0.0; .* >= 0.001"),
    (lambda s, cf: cf.uploadTrajectory(0, 0, trajectory(32)), "32 pieces .* no more than 31"),
    (lambda s, cf: cf.uploadTrajectory(0, 20, trajectory(12)), "from pieceOffset 20 on"),
    (
        lambda s, cf: cf.uploadTrajectory(0, 0, Trajectory()),
        "has no pieces; expected one at least",
    ),
    (lambda s, cf: cf.uploadTrajectory(0, 0, "figure8.csv"), "trajectory is 'figure8.csv'"),
    (lambda s, cf: cf.uploadTrajectory(0, 0, trajectory(x=[NAN])), "x of piece 0 is .*nan"),
    (lambda s, cf: cf.uploadTrajectory(0, 0, trajectory(x=[1] * 9)), "at most 8 finite"),
    (lambda s, cf: cf.uploadTrajectory(0, 0, trajectory(duration=0.0)), "duration of piece 0 is 0"),
    (lambda s, cf: cf.notifySetpointsStop(-1), "remainValidMillisecs is -1"),
    (lambda s, cf: cf.cmdFullState([0] * 3, [0] * 3, [0] * 2, 0, [0] * 3), "cmdFullState: acc is"),
    (lambda s, cf: cf.cmdVelocityWorld([0, 0, math.inf], 0), "cmdVelocityWorld: vel is .*inf"),
    (lambda s, cf: cf.cmdPosition([0, 0, 0], NAN), "cmdPosition: yaw is nan"),
    (lambda s, cf: cf.cmdHover(0, 0, NAN, 1), "cmdHover: yaw_rate is nan"),
    (lambda s, cf: cf.cmdVel(0, 0, 0, "full"), "cmdVel: thrust is 'full'"),
    (lambda s, cf: cf.getParam("ring"), "cf1.getParam: name is 'ring'; expected GROUP/NAME"),
    (lambda s, cf: cf.getParam("ring/effekt"), "name is ring.effekt; expected ring.effect, "),
    (lambda s, cf: cf.getParam("rink/effect"), "expected no group rink; there are .*ring"),
    (lambda s, cf: cf.setParam("ring/effect", "7"), "cf1.setParam: ring.effect is '7'"),
    (lambda s, cf: cf.setParams([1]), r"cf1.setParams: params is \[1\]; expected a dictionary"),
    (lambda s, cf: cf.setLEDColor(1, 0, 2), "cf1.setLEDColor: b is 2; .* >= 0 and <= 1"),
    (lambda s, cf: cf.enableCollisionAvoidance([], [0.1, 0.1]), "ellipsoidRadii is .* three"),
    (
        lambda s, cf: cf.enableCollisionAvoidance([], [0.1, 0.1, 0.0]),
        "ellipsoidRadii is .* >= 0.0",
    ),
    (lambda s, cf: cf.enableCollisionAvoidance([1], [1, 1, 1]), "others is .* Crazyflie"),
    (lambda s, cf: s.timeHelper.sleep(NAN), "timeHelper.sleep: duration is nan"),
    (lambda s, cf: s.timeHelper.sleepForRate(0), "timeHelper.sleepForRate: rateHz is 0"),
]


@pytest.mark.parametrize(("call", "message"), WRONG)
def test_a_wrong_argument(swarm, call, message):
    with pytest.raises(ValueError, match=message):
        call(swarm, swarm.allcfs.crazyflies[0])


def test_an_unknown_parameter_is_kept_with_a_warning(swarm, caplog):
    swarm.allcfs.setParam("usd.logging", 1)
    assert [record.getMessage() for record in caplog.records] == [
        "cf1.setParam: the simulation has no parameter usd.logging; it is stored without effect"
    ]
    assert swarm.allcfs.crazyflies[1].getParam("usd/logging") == 1


FLEETS = [
    ("crazyflies: [{id: 1, initialPosition: [0, 0]}]", "cf1/initial_position .* list of 3"),
    ("crazyflies: [{id: 300, initialPosition: [0, 0, 0]}]", "id is 300; expected an integer"),
    (
        "crazyflies: [{initialPosition: [0, 0, 0]}]",
        "crazyflies.0. has no id; it has initialPosition",
    ),
    (PAIR.replace("id: 2", "id: 1"), "id is also that of cf1 in line 3; expected another"),
    ("vehicles: {a: 1}", "has neither robots .* nor crazyflies"),
    ("crazyflies: [", "is not valid YAML"),
    ("crazyflies: []", "has no enabled vehicle"),
    (
        "robots: {cf1: {uri: usb, initial_position: [0, 0, 0]}}",
        "cf1/uri .* is 'usb'; expected radio",
    ),
    ("robots: {a: {initial_position: [0, 0, 0]}}", "a has no id: its address is None; expected"),
    (
        "robots: {cf1: {initial_position: [0, 0, 0]}, b1: {initial_position: [1, 0, 0]}}",
        "cf1, b1 have the same id, 1; expected different ids",
    ),
    ("robots: {cf1: 3}", "cf1 is 3; expected a mapping"),
]


@pytest.mark.parametrize(("fleet", "message"), FLEETS)
def test_a_wrong_fleet(fleet, message):
    with pytest.raises(ValueError, match=message):
        simulated(fleet=fleet)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--dt 0", "argument --dt: 0; expected 0.0001 to 10"),
        ("--maxvel nan", "argument --maxvel: nan; expected a number >= 0"),
        ("--vis opengl", "argument --vis: invalid choice: 'opengl'"),
    ],
)
def test_a_wrong_option(options, message, capsys):
    with pytest.raises(SystemExit):
        crazyflie_py.Crazyswarm(crazyflies_yaml=PAIR, args=f"--sim {options}")
    assert message in capsys.readouterr().err


def test_without_a_fleet_file_the_vehicles_of_the_examples_fly(tmp_path, monkeypatch, caplog):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["script.py"])
    assert [cf.id for cf in simulated(fleet=None).allcfs.crazyflies] == [1, 2]
    assert "no fleet file was found (../launch/crazyflies.yaml" in caplog.text


@pytest.mark.parametrize("key", [99, "cf99"])
def test_a_vehicle_that_is_not_there(swarm, key):
    found = swarm.allcfs.crazyfliesById if key == 99 else swarm.allcfs.crazyfliesByName
    with pytest.raises(KeyError, match=f"no vehicle has the key {key!r}; expected one of "):
        found[key]


def test_what_a_real_vehicle_refuses_is_a_warning(swarm, caplog):
    cf = swarm.allcfs.crazyflies[0]
    cf.setParam("stabilizer/controller", 9)
    cf.setParam("ring/effect", 300)
    cf.setParam("ring/effect", 7)
    cf.setParam("hlCommander/groupmask", 256)
    swarm.allcfs.takeoff(1.0, 2.0, groupMask=64)
    assert [record.getMessage() for record in caplog.records] == [
        "cf1.setParam: stabilizer.controller is 9; expected 0 to 2: a real vehicle refuses it",
        "cf1.setParam: ring.effect is 300; expected a uint8_t: a real vehicle refuses it",
        "cf1.setParam: hlCommander.groupmask is 256; expected a uint8_t: a real vehicle refuses it",
        "allcfs.takeoff: groupMask is 64, and setGroupMask has put no vehicle into these "
        "groups; all vehicles ignore the command",
    ]
