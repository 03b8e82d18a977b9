"""Trajectories of users' scripts, against derivatives by differences."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from uav_trajectory import Polynomial, Polynomial4D, Trajectory, TrajectoryOutput

from crazyflie_demo.figure8 import figure8
from crazyflie_demo.trajectory_file import TrajectoryError
from crazyflie_model.units import GRAVITY

FIGURE8 = Path(__file__).parents[1] / "data" / "figure8.csv"
STEP = 1e-4
COEFFICIENTS = st.lists(st.floats(-0.3, 0.3), min_size=8, max_size=8)
PIECES = st.builds(Polynomial4D, st.just(1.0), *[COEFFICIENTS] * 4)
TIMES = st.floats(0.0, 1.0)


def difference(function, time):
    return (np.asarray(function(time + STEP)) - function(time - STEP)) / (2.0 * STEP)


def attitude(piece, time):
    """Return the axes of the body, as columns: thrust along z, heading and x in one plane."""
    goal = piece.eval(time)
    z = goal.acc + [0.0, 0.0, 9.81]
    y = np.cross(z, [np.cos(goal.yaw), np.sin(goal.yaw), 0.0])
    x = np.cross(y, z)
    return np.column_stack([axis / np.linalg.norm(axis) for axis in (x, y, z)])


def test_a_polynomial():
    polynomial = Polynomial([1.0, 2.0, 3.0])
    assert polynomial.eval(2.0) == 17.0
    assert polynomial.derivative().eval(2.0) == 14.0
    assert Polynomial([4.0]).derivative().eval(1.0) == 0.0


@given(PIECES, TIMES)
def test_derivatives_of_a_piece(piece, time):
    goal = piece.eval(time)
    np.testing.assert_allclose(goal.vel, difference(lambda t: piece.eval(t).pos, time), atol=1e-5)
    np.testing.assert_allclose(goal.acc, difference(lambda t: piece.eval(t).vel, time), atol=1e-5)
    np.testing.assert_allclose(piece.derivative().eval(time).pos, goal.vel, atol=1e-12)
    assert piece.derivative().duration == piece.duration


@given(PIECES, TIMES)
def test_the_angular_velocity_tilts_the_thrust(piece, time):
    R = attitude(piece, time)  # noqa: N806
    # R^T dR/dt is the cross product with the angular velocity.
    rates = R.T @ difference(lambda t: attitude(piece, t), time)
    scale = 1.0 + np.abs(rates).max() ** 3
    np.testing.assert_allclose(
        piece.eval(time).omega[:2], [rates[2, 1], rates[0, 2]], atol=1e-5 * scale
    )


@given(COEFFICIENTS, COEFFICIENTS, TIMES)
def test_upright_the_vehicle_turns_at_the_yaw_rate(pz, pyaw, time):
    piece = Polynomial4D(1.0, [0.0], [0.0], pz, pyaw)
    # Where it falls faster than freely, the thrust points down.
    assume(piece.eval(time).acc[2] > -9.0)
    rate = difference(lambda t: piece.eval(t).yaw, time)
    assert piece.eval(time).omega == pytest.approx([0.0, 0.0, rate], abs=1e-5)


def test_a_trajectory_of_a_file():
    trajectory = Trajectory()
    trajectory.loadcsv(FIGURE8)
    assert trajectory.duration == pytest.approx(10.0)
    assert len(trajectory.polynomials) == 10
    for time in np.linspace(0.0, trajectory.duration, 37):
        k = min(int(time), 9)
        np.testing.assert_allclose(
            trajectory.eval(time).pos, figure8()[k].evaluate(time - k).position, atol=1e-6
        )
    end = trajectory.eval(trajectory.duration)
    assert isinstance(end, TrajectoryOutput)
    np.testing.assert_allclose([*end.pos, *end.vel, *end.acc, *end.omega, end.yaw], 0.0, atol=1e-5)


@pytest.mark.parametrize("time", [-0.1, 10.1, float("nan")])
def test_is_not_in_progress_before_and_after(time):
    trajectory = Trajectory()
    with pytest.raises(ValueError, match="takes 0 to 0 s"):
        trajectory.eval(0.0)
    trajectory.loadcsv(FIGURE8)
    with pytest.raises(ValueError, match="takes 0 to 10 s"):
        trajectory.eval(time)


def test_a_bad_file_is_refused(tmp_path):
    with pytest.raises(TrajectoryError):
        Trajectory().loadcsv(tmp_path / "none.csv")


def test_a_trajectory_is_saved_as_it_is(tmp_path):
    trajectory = Trajectory()
    trajectory.loadcsv(FIGURE8)
    trajectory.polynomials[0].pyaw = Polynomial([0.0])
    trajectory.savecsv(tmp_path / "saved.csv")
    saved = Trajectory()
    saved.loadcsv(str(tmp_path / "saved.csv"), skip_header=True)
    assert saved.n_pieces() == trajectory.n_pieces() == len(trajectory.polynomials)
    for time in np.linspace(0.0, trajectory.duration, 50):
        np.testing.assert_allclose(saved.eval(time).pos, trajectory.eval(time).pos, atol=1e-6)


def test_a_stretched_trajectory_has_the_same_path():
    trajectory, stretched = Trajectory(), Trajectory()
    trajectory.loadcsv(FIGURE8)
    stretched.loadcsv(FIGURE8)
    stretched.stretchtime(2.0)
    assert stretched.duration == pytest.approx(2.0 * trajectory.duration)
    for time in np.linspace(0.0, trajectory.duration, 50):
        before, after = trajectory.eval(time), stretched.eval(2.0 * time)
        np.testing.assert_allclose(after.pos, before.pos, atol=1e-9)
        np.testing.assert_allclose(after.vel, before.vel / 2.0, atol=1e-9)
        np.testing.assert_allclose(after.acc, before.acc / 4.0, atol=1e-9)
    with pytest.raises(ValueError, match="factor is 0.0; expected a number > 0"):
        stretched.stretchtime(0.0)


def test_jerk_snap_and_attitude_are_those_of_the_polynomials():
    # x = t^4 / 24, y = t^3 / 6: at t = 1 s, in m and s.
    piece = Polynomial4D(2.0, [0, 0, 0, 0, 1 / 24], [0, 0, 0, 1 / 6], [1.0], [0.0])
    output = piece.eval(1.0)
    assert output.acc == pytest.approx([0.5, 1.0, 0.0])
    assert output.jerk == pytest.approx([1.0, 1.0, 0.0])
    assert output.snap == pytest.approx([1.0, 0.0, 0.0])
    # A positive pitch accelerates ahead, a negative roll to the left.
    thrust = np.array([0.5, 1.0, GRAVITY])
    thrust /= np.linalg.norm(thrust)
    sin_roll, cos_roll = math.sin(output.roll), math.cos(output.roll)
    sin_pitch, cos_pitch = math.sin(output.pitch), math.cos(output.pitch)
    assert thrust == pytest.approx([sin_pitch * cos_roll, -sin_roll, cos_pitch * cos_roll])
