"""The bounds that a fence needs, from flights."""

import dataclasses

import numpy as np
import pytest
from excited_flights import KIND, drawn, fly

from crazyflie_geofence import bounds as fence_bounds
from crazyflie_identification import fit, residual
from crazyflie_utils.parameters import model_file

from test_fit import DEFAULT  # isort: skip


@pytest.fixture(scope="module")
def true():
    return drawn(7)


@pytest.fixture(scope="module")
def recording(true):
    return fly(true, DEFAULT, duration=22.0)[0]


def identified(recording):
    found = fit.identify(recording, KIND)
    return found, residual.bounds(found)


def test_an_ideal_vehicle_in_still_air_is_hardly_disturbed(true, recording, tmp_path):
    found, limits = identified(recording)
    assert limits["delay"] == pytest.approx(true.delay, abs=0.002)
    assert limits["lag"]["horizontal"] == pytest.approx(
        max(true.roll_lag, true.pitch_lag), abs=0.01
    )
    # Drag at 1 m/s, unequal lags of roll and pitch, and noise.
    assert 0.0 < limits["disturbance"]["horizontal"] < 0.6
    assert 0.0 < limits["disturbance"]["vertical"] < 0.6
    assert 0.0 < limits["error"]["position"] < 0.005
    # A control has its effect a lag later than the filter thinks.
    assert 0.02 < limits["error"]["velocity"] < 0.3
    assert limits["seconds"] == pytest.approx(20.0, abs=3.0)
    # The fence reads them from the model file.
    path = tmp_path / "mine.yaml"
    model_file.save(path, "cf21_markers", found.model, {"bounds": limits})
    read = fence_bounds.complete(fence_bounds.Bounds(), str(path))
    assert read.horizontal_disturbance == limits["disturbance"]["horizontal"]
    assert read.velocity_error == limits["error"]["velocity"]


def test_gusts_are_disturbances(recording):
    """A push along x with 1 m/s^2 for 0.4 s every 4 s: more than 0.1 % of the time."""
    _, calm = identified(recording)
    times = recording.pose_times - recording.pose_times[0]
    push = np.where(times % 4.0 < 0.2, 1.0, np.where(times % 4.0 < 0.4, -1.0, 0.0))
    step = np.gradient(times)
    moved = recording.poses.copy()
    moved[:, 0] += np.cumsum(np.cumsum(push * step) * step)
    _, gusty = identified(dataclasses.replace(recording, poses=moved))
    more = gusty["disturbance"]["horizontal"] - calm["disturbance"]["horizontal"]
    assert 0.5 < more < 1.3
    assert gusty["disturbance"]["vertical"] == pytest.approx(
        calm["disturbance"]["vertical"], abs=0.2
    )
