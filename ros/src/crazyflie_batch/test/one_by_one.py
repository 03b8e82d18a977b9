"""One flight of a batch by the classes that the nodes have: the reference."""

from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from crazyflie_batch import FiniteDifferences, Kalman, simulation
from crazyflie_batch.batch import Batch
from crazyflie_lqr import linear_feedback
from crazyflie_lqr.linear_feedback import IntegralStateFeedback
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_simulator.vehicle import MotionCapture, SimulatedVehicle
from crazyflie_state_estimator.motion import (
    ConstantAccelerationFilter,
    FiniteDifference,
    MotionEstimator,
)

_YAW = 6
_FILTERS: dict[Any, Any] = {FiniteDifferences: FiniteDifference, Kalman: ConstantAccelerationFilter}


def prepare(*args: Any, **kwargs: Any) -> Batch:
    """Return the flights of `simulate` before they are flown."""
    with mock.patch.object(simulation, "fly", lambda batch, record, threads: batch):
        return simulation.simulate(*args, **kwargs)


def fly_one(batch: Batch, index: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the flight of one vehicle of a batch.

    Returns
    -------
    states : ndarray, shape (ticks + 1, x_dim)
        Of the model at every tick, and at the end.
    controls : ndarray, shape (ticks, 4)
        The control that was in force from every tick on; zeros before the first.
    """
    plan, period = batch.plan, batch.plan.period
    own = {name: values[:, index].tolist() for name, values in batch.parameters.items()}
    vehicle = SimulatedVehicle(plan.model(own), batch.x[:3, index].tolist(), 0.0, plan.max_tilt)
    filter_ = _FILTERS[plan.estimator](*own["estimator"])
    estimator = MotionEstimator(filter_, FiniteDifference())
    controller = IntegralStateFeedback(
        np.reshape(own["K"], (linear_feedback.U_DIM, linear_feedback.X_DIM)),
        np.array(own["u_ref"]),
        _YAW,
        own["integrator_k"],
        own["integrator_limit"],
    )
    (position_noise, attitude_noise), (dropout,) = own["noise"], own["dropout"]
    random: Any = _Replay(batch.noise_samples(index), has_position_noise=position_noise > 0.0)
    motion_capture = MotionCapture(
        position_noise, attitude_noise, own["delay"][0] * period, dropout, random
    )
    goal = np.array(own["goal"])
    states, controls = [vehicle.state], []
    control: NDArray[np.float64] = np.zeros(linear_feedback.U_DIM)
    for tick in range(batch.ticks):
        moment = tick * period
        random.begin(tick)
        vehicle.advance_to(moment)
        motion_capture.measure(moment, *vehicle.pose)
        for stamp, position, quaternion in motion_capture.arrivals(moment):
            attitude = rpy_from_quaternion(*quaternion)
            motion = estimator.update(round(stamp * 1e9), position, attitude)
            if motion is not None:
                x = np.array([*motion.position, *motion.velocity, motion.attitude[2]])
                control = controller.control(x, goal, stamp)
                vehicle.command(control.tolist())
        controls.append(control)
        vehicle.advance_to(moment + period)
        states.append(vehicle.state)
    return np.array(states), np.array(controls)


class _Replay(np.random.Generator):
    """Has `MotionCapture` draw the random numbers that the batch has drawn."""

    def __init__(self, samples: NDArray[np.float64], has_position_noise: bool):
        super().__init__(np.random.PCG64())
        self._samples = samples
        self._has_position_noise = has_position_noise

    def begin(self, tick: int) -> None:
        """Draw the numbers of a tick from now on."""
        self._tick = tick
        noise = self._samples[tick]
        self._next = [noise[:3], noise[3:6]] if self._has_position_noise else [noise[3:6]]

    def random(self) -> Any:  # type: ignore[override]
        """Return the number by which the pose is lost."""
        return self._samples[self._tick, 6]

    def normal(self, mean: float, deviation: float, size: int) -> Any:  # type: ignore[override]
        """Return the noise of the position, then that of the attitude."""
        return deviation * self._next.pop(0)
