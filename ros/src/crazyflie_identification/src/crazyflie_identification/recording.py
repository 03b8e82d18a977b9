"""Commands and poses of a flight in a bag, for the fit."""

import tempfile
from operator import itemgetter
from pathlib import Path

import numpy as np

from crazyflie_identification.fit import LEAST_TIME, IdentificationError, Recording
from crazyflie_model.angles import quaternion_from_rpy, zyx_from_quaternion
from crazyflie_model.quadrotor import QuadrotorParameters
from crazyflie_model.units import pwm_from_thrust
from crazyflie_reports import bag_log
from crazyflie_reports.bag_flights import OTHER_CLOCK, flights, vehicles

_BEGINNING = 1.0  #: Time after the takeoff in which the vehicle settles, s.


def of_bag(path: Path, kind: QuadrotorParameters, name: str = "") -> Recording:
    """Return the longest flight of a bag, without takeoff and landing.

    Commands are those of the driver (cmd_vel); in simulation the final controls, of which 9.81
    m/s^2 carries a vehicle of the type ``kind``. ``name`` is the vehicle, if there are several.
    `BagError`: the bag cannot be read. `IdentificationError`: it has no such flight.
    """
    with tempfile.TemporaryDirectory() as folder:
        logs = bag_log.read(path, Path(folder))
        found = [
            (phase.end - phase.start, phase.start, flight.vehicle)
            for log in logs
            for flight in flights(log)
            for phase in flight.phases
            if phase.name == "flying" and name in ("", flight.vehicle.name)
        ]
        names = () if found else [each.name for log in logs for each in vehicles(log)]
    if name and not found and name not in names:
        raise IdentificationError(
            f"{path} has no vehicle {name}; expected one of {', '.join(names) or 'none'}"
        )
    if not found:
        raise IdentificationError(
            f"{path} has no flight; expected one of {LEAST_TIME:g} s and more"
        )
    duration, start, vehicle = max(found, key=itemgetter(0))
    return _recording(path, vehicle, kind).between(start + _BEGINNING, start + duration)


def _recording(path, vehicle, kind):
    poses = vehicle.attitude
    is_driven = len(vehicle.command) > 0
    rows = vehicle.command if is_driven else vehicle.control
    # Every node rejects commands that are not finite; the one before holds.
    rows = rows[np.isfinite(rows[:, :5]).all(axis=1)]
    for what, there in (("poses with an attitude (/tf or pose)", poses), ("commands", rows)):
        if len(there) < 2:
            raise IdentificationError(
                f"{path} has no {what} of {vehicle.name}; expected {LEAST_TIME:g} s of them"
            )
    commands = rows[:, 1:].copy()
    commands[:, 3] = pwm_from_thrust(rows[:, 4]) if is_driven else kind.pwm(rows[:, 4])
    # The time of a pose is its stamp, if the stamp is of the same clock.
    stamps = vehicle.pose_stamps
    offsets = stamps[:, 0] - stamps[:, 1]
    has_clock = len(stamps) == len(poses) and abs(float(np.median(offsets))) < OTHER_CLOCK
    times = stamps[:, 1] if has_clock else poses[:, 0]
    attitudes = zyx_from_quaternion(quaternion_from_rpy(*poses[:, 4:].T))
    poses = np.column_stack([poses[:, :4], *attitudes])
    finite = np.isfinite(poses).all(axis=1) & np.r_[True, np.diff(times) > 1e-4]
    return Recording(rows[:, 0], commands, times[finite], poses[finite, 1:])
