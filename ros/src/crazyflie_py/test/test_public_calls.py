"""Every public call of scripts, compared with Crazyswarm and crazyswarm2 1.0.5."""

import inspect
import math

import numpy as np
import pytest
from sim import hovering, simulated
from uav_trajectory import Polynomial4D, Trajectory, TrajectoryOutput

from crazyflie_py import Crazyswarm
from crazyflie_py.crazyflie import Crazyflie, CrazyflieServer
from crazyflie_py.simulation import Simulation

CLIMB = "targetHeight, duration, groupMask=0"
START = "trajectoryId, timescale=1.0, reverse=False, relative=True, groupMask=0"
FULL_STATE = "pos, vel, acc, yaw, omega"

# Names, order and defaults of arguments; arguments that are only here follow with defaults.
VEHICLE = {
    "setGroupMask": "groupMask",
    "enableCollisionAvoidance": "others, ellipsoidRadii",
    "disableCollisionAvoidance": "",
    "emergency": "",
    "takeoff": CLIMB,
    "land": CLIMB,
    "stop": "groupMask=0",
    "goTo": "goal, yaw, duration, relative=False, groupMask=0",
    "uploadTrajectory": "trajectoryId, pieceOffset, trajectory",
    "startTrajectory": START,
    "notifySetpointsStop": "remainValidMillisecs=100, groupMask=0",
    "arm": "arm=True",
    "position": "",
    "velocity": "",
    "acceleration": "",
    "rpy": "",
    "yaw": "",
    "get_position": "",
    "get_pose": "",
    "get_status": "",
    "getParam": "name",
    "setParam": "name, value",
    "setParams": "params",
    "cmdFullState": FULL_STATE,
    "cmdVelocityWorld": "vel, yawRate",
    "cmdStop": "",
    "cmdVel": "roll, pitch, yawrate, thrust",
    "cmdPosition": "pos, yaw=0.0",
    "cmdHover": "vx, vy, yaw_rate, z_distance",
    "setLEDColor": "r, g, b",
}
ALL = {
    "emergency": "",
    "takeoff": CLIMB,
    "land": CLIMB,
    "stop": "groupMask=0",
    "goTo": "goal, yaw, duration, groupMask=0",
    "startTrajectory": START,
    "notifySetpointsStop": "remainValidMillisecs=100, groupMask=0",
    "arm": "arm=True",
    "setParam": "name, value",
    "cmdFullState": FULL_STATE,
}
TIME = {
    "time": "",
    "sleep": "duration",
    "sleepForRate": "rateHz",
    "isShutdown": "",
    "nextPhase": "",
}
TRAJECTORY = {"n_pieces": "", "loadcsv": "filename", "eval": "t"}
PIECE = {"derivative": "", "eval": "t"}
CALLS = [
    (each, name, arguments)
    for each, calls in (
        (Crazyflie, VEHICLE),
        (CrazyflieServer, ALL),
        (Simulation, TIME),
        (Trajectory, TRAJECTORY),
        (Polynomial4D, PIECE),
    )
    for name, arguments in calls.items()
]


@pytest.mark.parametrize(("owner", "name", "arguments"), CALLS)
def test_names_order_and_defaults_of_arguments(owner, name, arguments):
    found = [*inspect.signature(getattr(owner, name)).parameters.values()][1:]
    bare = [str(each.replace(annotation=each.empty)) for each in found]
    expected = [each for each in arguments.split(", ") if each]
    assert bare[: len(expected)] == expected
    assert all(each.default is not each.empty for each in found[len(expected) :])


@pytest.mark.parametrize(("owner", "calls"), [(Crazyflie, VEHICLE), (CrazyflieServer, ALL)])
def test_no_public_call_is_missing_in_the_table(owner, calls):
    public = {name for name, _ in inspect.getmembers(owner, callable) if not name.startswith("_")}
    assert public == calls.keys()


TURN = 0.5  #: Of each setpoint below within a second, rad.


@pytest.mark.parametrize(
    "send",
    [
        lambda cf: cf.cmdHover(0.0, 0.0, TURN, 1.0),
        lambda cf: cf.cmdHover(vx=0.0, vy=0.0, yaw_rate=TURN, z_distance=1.0),
        lambda cf: cf.cmdVelocityWorld([0.0, 0.0, 0.0], math.degrees(TURN)),
        lambda cf: cf.cmdVelocityWorld(vel=[0.0, 0.0, 0.0], yawRate=math.degrees(TURN)),
        lambda cf: cf.cmdPosition([1.0, 0.0, 1.0], TURN),
        lambda cf: cf.cmdFullState([1.0, 0.0, 1.0], [0] * 3, [0] * 3, TURN, [0] * 3),
        lambda cf: cf.goTo([1.0, 0.0, 1.0], TURN, 1.0),
    ],
)
def test_units_of_angles_and_rates(send):
    swarm = hovering()
    cf = swarm.allcfs.crazyflies[0]
    send(cf)
    swarm.timeHelper.sleep(1.0)
    assert cf.yaw() == pytest.approx(TURN, abs=0.01)
    assert cf.position() == pytest.approx([1.0, 0.0, 1.0], abs=0.01)


def test_a_yaw_rate_in_degrees_is_refused():
    cf = hovering().allcfs.crazyflies[0]
    with pytest.raises(ValueError, match=r"cf1.cmdHover: yaw_rate is 30; expected .* 6.98"):
        cf.cmdHover(0.0, 0.0, 30, 1.0)


def test_types_of_results():
    swarm = hovering()
    cf, helper = swarm.allcfs.crazyflies[0], swarm.timeHelper
    for vector in (cf.position(), cf.velocity(), cf.acceleration(), cf.initialPosition):
        assert isinstance(vector, np.ndarray)
        assert vector.shape == (3,)
    assert [type(each) for each in (*cf.rpy(), cf.yaw(), *cf.get_position())] == [float] * 7
    assert type(cf.get_position()) is list
    pose = cf.get_pose()
    assert pose.keys() == {"position", "orientation"}
    orientation = pose["orientation"]
    assert (pose["position"].z, orientation.w, orientation.x) == pytest.approx((1.0, 1.0, 0.0))
    assert cf.get_status().keys() >= {
        *("id", "timestamp_sec", "timestamp_nsec", "supervisor", "battery", "pm_state", "rssi"),
        *("num_rx_broadcast", "num_tx_broadcast", "num_rx_unicast", "num_tx_unicast"),
    }
    cf.setParam("ring/effect", 7)
    assert cf.getParam("ring.effect") == 7
    assert (type(cf.id), type(cf.name), cf.prefix) == (int, str, "/cf1")
    assert (type(helper.time()), helper.isShutdown()) == (float, False)


def test_what_a_script_begins_with():
    swarm = simulated()
    assert isinstance(swarm, Crazyswarm)
    allcfs = swarm.allcfs
    assert allcfs.crazyfliesById[1] is allcfs.crazyfliesByName["cf1"] is allcfs.crazyflies[0]
    assert {"time", "sleep"} <= {*dir(swarm.timeHelper)}
    assert callable(swarm.input.checkIfButtonIsPressed)


def test_an_output_of_a_trajectory_is_filled_by_hand():
    swarm = hovering()
    cf, output = swarm.allcfs.crazyflies[0], TrajectoryOutput()
    for name in ("pos", "vel", "acc", "omega", "yaw", "jerk", "snap", "roll", "pitch"):
        assert getattr(output, name) is None
    output.pos, output.yaw = np.array([1.0, 0.5, 1.0]), 0.2
    output.vel = output.acc = output.omega = np.zeros(3)
    cf.cmdFullState(output.pos, output.vel, output.acc, output.yaw, output.omega)
    swarm.timeHelper.sleep(0.1)
    assert cf.position() == pytest.approx(output.pos)
