"""A model that flies in place of the recorded vehicle, in the recorded wind."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crazyflie_model.angles import Quaternion, Triple
from crazyflie_model.dynamics import STEP, Coupled7D, Dynamics, NearHover, watchdog_control
from crazyflie_model.first_order_quadrotor import FirstOrderQuadrotor
from crazyflie_model.quadrotor import QuadrotorParameters
from crazyflie_model.units import pwm_from_thrust
from crazyflie_reports.bag_flights import Vehicle
from crazyflie_utils.parameters import vehicle_model

Array = NDArray[np.float64]

PERIOD = 0.01  #: Period at which a recorded motion is compared with the model (s).
WINDOW = 0.3  #: Length of the cubic polynomials that are fitted to the motion (s).
#: Height above the lowest pose from which what the model does not explain is the air's (m).
LIFTED = 0.05
IDEAL = {"near_hover": NearHover, "coupled_7d": Coupled7D}  #: The simulator's models by name.

_STEPS = round(PERIOD / STEP)
_YAW = {7: 6, 11: 8}  # Index of the yaw in a state, by its dimension.


@dataclass(frozen=True)
class VehicleModel:
    """A model, and how it takes the commands of a recording."""

    name: str  #: For people.
    dynamics: Dynamics
    delay: float = 0.0  #: From a command to the motion (s).
    #: Thrust curve and trims of a vehicle whose commands are those of a driver.
    figures: QuadrotorParameters | None = None

    @classmethod
    def of(cls, name: str, is_driven: bool, known_as: str = "") -> "VehicleModel":
        """Return one of `IDEAL`, of a type of vehicle, or of a model file.

        ``is_driven``: the commands are those to a driver, by which not every vehicle hovers at 9.81
        m/s^2. `ParameterError` names what is wrong with a file.
        """
        if name in IDEAL:
            return cls(known_as or name, IDEAL[name]())
        figures = vehicle_model.load(name)
        model = FirstOrderQuadrotor(figures)
        return cls(known_as or name, model, figures.delay, figures if is_driven else None)

    def control(self, command: Sequence[float]) -> list[float]:
        """Return what the dynamics take of a command: roll, pitch, yaw rate, thrust; SI units."""
        roll, pitch, yaw_dot, thrust = map(float, command)
        if self.figures is not None:
            roll, pitch = roll - self.figures.roll_trim, pitch - self.figures.pitch_trim
            thrust = float(self.figures.thrust(pwm_from_thrust(thrust)))
        return [roll, pitch, yaw_dot, max(thrust, 0.0)]


@dataclass(frozen=True)
class Explained:
    """A recorded motion, and what a model has to add to be moved like that.

    All arrays have a row for each of ``times`` (s), `PERIOD` apart.
    """

    times: Array
    states: Array  #: States of the model: the recorded motion, the model's attitude.
    controls: Array  #: What the model's controls were, shape (n, 4).
    wind: Array  #: Recorded acceleration minus the model's, shape (n, 3), m/s^2.
    ground: float  #: The lowest recorded height (m).

    @property
    def rms(self) -> float:
        """Root mean square of the acceleration that the model does not explain (m/s^2)."""
        flown = self.wind[self.wind.any(axis=1)]
        return float(np.sqrt((flown**2).sum(axis=1).mean())) if len(flown) else 0.0

    def index(self, time: float) -> int:
        """Return the row of a time (s); the first or the last one beyond them."""
        place = round((time - float(self.times[0])) / PERIOD)
        return min(max(place, 0), len(self.times) - 1)


def explain(model: VehicleModel, vehicle: Vehicle, start: float, end: float) -> Explained | None:
    """Compare a vehicle's motion between two times (s) with a model under the recorded commands.

    Attitude and thrust are the model's; position, velocity and yaw are set to the recorded ones in
    each period. None without poses, or without commands, in that time.
    """
    commands = vehicle.command if len(vehicle.command) else vehicle.control
    commands = commands[np.isfinite(commands).all(axis=1)]
    poses = vehicle.attitude if len(vehicle.attitude) else vehicle.state[:, [0, 1, 2, 3, 7, 7, 7]]
    poses = poses[np.isfinite(poses[:, :4]).all(axis=1)]
    poses = poses[(poses[:, 0] >= start - 1.0) & (poses[:, 0] <= end + 1.0)]
    if not len(poses) or not len(commands):
        return None
    first, last = max(start, float(poses[0, 0])), min(end, float(poses[-1, 0]))
    times = first + PERIOD * np.arange(max(0, math.ceil((last - first) / PERIOD)), dtype=float)
    if len(times) <= WINDOW / PERIOD:
        return None
    position = np.column_stack([np.interp(times, poses[:, 0], poses[:, k]) for k in (1, 2, 3)])
    turns = np.unwrap(np.nan_to_num(poses[:, 6]))
    yaw = np.interp(times, poses[:, 0], turns)
    ground = float(position[:, 2].min())
    position = position - [0.0, 0.0, ground]
    velocity = _fitted(position, 1)
    newest = np.searchsorted(commands[:, 0], times - model.delay, side="right") - 1
    controls = np.array([model.control(row) for row in commands[:, 1:5]])[np.maximum(newest, 0)]
    controls[newest < 0] = 0.0
    dynamics = model.dynamics
    x = dynamics.initial_state(position[0].tolist())
    at = _YAW[dynamics.x_dim]
    states, accelerations = np.empty((len(times), len(x))), np.empty_like(position)
    for k in range(len(times)):
        x[:6], x[at] = [*position[k].tolist(), *velocity[k].tolist()], float(yaw[k])
        states[k] = x
        u = controls[k].tolist()
        # Above the ground, which is not part of the air.
        x[2] = max(x[2], 1.0)
        x = dynamics.steps(_STEPS, k * _STEPS, x, u)
        accelerations[k] = (np.array(x[3:6]) - velocity[k]) / PERIOD
    flown = _twice_integrated(accelerations)
    wind = _fitted(position - flown, 2)
    wind[position[:, 2] < LIFTED] = 0.0
    return Explained(times, states, controls, wind, ground)


def _twice_integrated(accelerations):
    """Return the positions (m) to which accelerations lead that are constant in each period."""
    velocity = np.vstack([np.zeros(3), np.cumsum(accelerations, axis=0)[:-1]]) * PERIOD
    steps = velocity * PERIOD + accelerations * PERIOD**2 / 2.0
    return np.vstack([np.zeros(3), np.cumsum(steps, axis=0)[:-1]])


def _fitted(values, order):
    """Return a derivative of rows `PERIOD` apart, by a cubic polynomial around each.

    The filter of A. Savitzky and M. Golay, Analytical Chemistry 36 (1964). At the ends it is that
    of the first and the last whole window.
    """
    half = round(WINDOW / PERIOD / 2.0)
    moments = np.arange(-half, half + 1) * PERIOD
    weights = np.linalg.pinv(np.vander(moments, 4, increasing=True))[order] * math.factorial(order)
    inner = np.column_stack([np.convolve(each, weights[::-1], "valid") for each in values.T])
    return np.pad(inner, ((half, half), (0, 0)), mode="edge")


class FlownModel:
    """A model that continues a recorded flight from a moment (s) on, by the controls of `command`.

    The state is the recorded one; what the model did not explain then accelerates it at the same
    times, as a wind does.
    """

    def __init__(self, model: VehicleModel, recorded: Explained, start: float):
        first = recorded.index(start)
        self.time = start  #: Time of the state (s).
        self._model, self._recorded = model, recorded
        self._x = recorded.states[first].tolist()
        self._u = recorded.controls[first].tolist()
        self._begin, self._steps, self._set = start, 0, 0
        self._pending: deque[tuple[int, list[float]]] = deque()

    def command(self, command: Sequence[float], time: float) -> None:
        """Set the control from a time (s), and the delay, on."""
        step = math.ceil((time + self._model.delay - self._begin) / STEP - 1e-6)
        self._pending.append((step, self._model.control(command)))

    def advance_to(self, time: float) -> None:
        """Fly until a time (s)."""
        end = math.floor((time - self._begin) / STEP + 1e-6)
        while self._steps < end:
            while self._pending and self._pending[0][0] <= self._steps:
                self._set, self._u = self._pending.popleft()
            wind = self._recorded.wind[self._recorded.index(self.time)].tolist()
            u = watchdog_control(self._u, self._steps - self._set)
            x = self._model.dynamics.step(self._steps, self._x, u)
            if x[2] > LIFTED:
                x[3:6] = [v + a * STEP for v, a in zip(x[3:6], wind, strict=True)]
            self._x = x
            self._steps += 1
            self.time = self._begin + self._steps * STEP

    def pose(self, time: float) -> tuple[Triple, Quaternion]:
        """Return position (m) and quaternion (x, y, z, w) at a time (s), in the recorded frame."""
        self.advance_to(time)
        (x, y, z), rotation = self._model.dynamics.pose(self._x, self._u)
        # A step is a millimetre at 1 m/s, and would be seen as noise of the velocity.
        rest = time - self.time
        vx, vy, vz = self._x[3:6]
        return (x + rest * vx, y + rest * vy, z + rest * vz + self._recorded.ground), rotation
