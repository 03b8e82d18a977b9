"""No takeoff before the vehicle's Kalman filter has converged."""

import math

import pytest
from conftest import LOG, PARAMETERS
from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from safety_helpers import TAKEOFF

from crazyflie_driver.monitors import FEWEST, WINDOW, Variances
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.testing import virtual_vehicle

NAMES = ("kalman.varPX", "kalman.varPY", "kalman.varPZ")
VARIANCES = {name: ("f", 1e-4) for name in NAMES}
KALMAN, UNSCENTED = ({"stabilizer.estimator": ("B", kind, 0)} for kind in (2, 3))


def watched(samples):
    variances = Variances()
    variances.is_logged = True
    for sample in samples:
        variances.add(sample)
    return variances.problem()


def test_a_filter_that_has_converged():
    assert watched([(1e-4, 1e-4, 2e-4)] * WINDOW) == ""
    # As in cflib, below 0.001 within ten samples.
    drift = [(1e-4, 1e-4, 1e-4 + 0.00099 * i / (WINDOW - 1)) for i in range(WINDOW)]
    assert watched(drift) == ""


def test_the_worst_variance_is_named():
    drift = [(1e-4, 1e-4 + 0.0004 * i, 1e-4 + 0.0002 * i) for i in range(WINDOW)]
    problem = watched(drift)
    assert problem == (
        "kalman.varPY has changed by 0.0036 m^2/s^2 within 4.5 s; expected less than 0.001"
    )
    assert "kalman.varPX has changed by nan" in watched([(math.nan, 0.0, 0.0)] * WINDOW)


def test_it_need_not_have_converged_ten_samples_ago():
    assert watched([(100.0, 100.0, 100.0)] * 5 + [(1e-4,) * 3] * FEWEST) == ""
    assert watched([(100.0, 100.0, 100.0)] * 5 + [(1e-4,) * 3] * (FEWEST - 1)) != ""


def add(server, estimator, log):
    vehicle = server.make_vehicle(log={**LOG, **log}, parameters={**PARAMETERS, **estimator})
    server.add(vehicle.uri, enable_parameters=True)
    return vehicle


def test_a_takeoff_waits_for_the_filter(server):
    vehicle = add(server, KALMAN, VARIANCES)
    vehicle.log["kalman.varPZ"] = ("f", 0.5)
    variances = server.node._vehicles[vehicle.uri].log.variances
    wait_until(lambda: variances._samples and variances._samples[-1][2] == 0.5)
    vehicle.log["kalman.varPZ"] = ("f", 0.25)
    with pytest.raises(ServiceError, match="no takeoff, .*not converged: kalman.varPZ has changed"):
        server.call("/cf1/takeoff", TAKEOFF)
    assert vehicle.packets(8, 0) == []
    wait_until(lambda: len({sample[2] for sample in variances._samples[-FEWEST:]}) == 1)
    server.call("/cf1/takeoff", TAKEOFF)
    assert len(vehicle.packets(8, 0)) == 1


@pytest.mark.parametrize(
    ("estimator", "log"), [(KALMAN, {}), ({}, VARIANCES), (UNSCENTED, VARIANCES)]
)
def test_without_a_kalman_filter_nothing_is_refused(server, estimator, log):
    vehicle = add(server, estimator, log)
    if log:
        vehicle.log["kalman.varPX"] = ("f", math.nan)
    server.call("/cf1/takeoff", TAKEOFF)
    assert len(vehicle.packets(8, 0)) == 1


def test_a_virtual_vehicle_without_poses(server):
    with virtual_vehicle(positioning="none") as (_, uri):
        server.add(uri)
        with pytest.raises(ServiceError, match="not converged: kalman.varP. has changed by"):
            server.call("/cf1/takeoff", TAKEOFF)
        variances = server.node._vehicles[uri].log.variances

        def is_converged():
            pose = Pose(orientation=Quaternion(w=1.0))
            server.process.publish("/cf1/external_pose", PoseStamped(pose=pose))
            return not variances.problem()

        wait_until(is_converged)
        server.call("/cf1/takeoff", TAKEOFF)
