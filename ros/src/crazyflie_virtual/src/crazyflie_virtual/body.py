"""The body of a virtual vehicle: battery, airframe on its feet, ranging and inertial sensors."""

import math
import random
from collections import deque
from typing import NamedTuple

from crazyflie_model.aerodynamics import Air, ground_effect
from crazyflie_model.angles import (
    Quaternion,
    Triple,
    product,
    quaternion_from_zyx,
    rotate,
    rotate_back,
    zyx_from_quaternion,
)
from crazyflie_model.dynamics import rk4_step
from crazyflie_model.elementwise import Vector, clip
from crazyflie_model.first_order_quadrotor import FirstOrderQuadrotor
from crazyflie_model.inner_loops import PERIOD
from crazyflie_model.quadrotor import CRAZYFLIE, QuadrotorParameters
from crazyflie_model.stabilized_quadrotor import STILL_AIR, Airframe
from crazyflie_model.units import GRAVITY
from crazyflie_world.world import World

_CAPACITY = 900.0  #: Charge of the stock battery, C: 250 mAh [Bitcraze, data sheet].
#: Resistance of cell and leads (ohm): about 0.3 V of sag at hover, as vehicles log it.
_RESISTANCE = 0.14
_HOVER_CURRENT = 2.1  #: Current at hover (A), from the 7 minutes of flight of the data sheet.
_IDLE_CURRENT = 0.12  #: Current of the electronics (A).

#: Open-circuit voltage (V) at a state of charge of 0, 0.1, ..., 1: the firmware's table of the
#: stock battery, and 4.2 V when full.
OPEN_CIRCUIT_VOLTAGES = (3.00, 3.78, 3.83, 3.87, 3.89, 3.92, 3.96, 4.00, 4.04, 4.10, 4.20)

FULL_VOLTAGE = OPEN_CIRCUIT_VOLTAGES[-1]

#: State of charge at which the voltage in flight is low (3.2 V) but not yet critical (3.0 V).
LOW_CHARGE = 0.055


class Battery:
    """One lithium-polymer cell; ``charge`` is the state of charge, 0 to 1."""

    def __init__(self, charge: float = 1.0):
        self.charge = charge
        self.current = _IDLE_CURRENT  #: A.
        self.voltage = open_circuit_voltage(charge)  #: Voltage under the load of the last step (V).

    def step(self, dt: float, load: float) -> None:
        """Drain for ``dt`` (s).

        ``load`` is the mean of the third powers of the rotor speeds over the hover speed's: the
        power of a rotor goes with the third power of its speed.
        """
        self.current = _IDLE_CURRENT + _HOVER_CURRENT * load
        self.charge = max(0.0, self.charge - self.current * dt / _CAPACITY)
        self.voltage = max(0.0, open_circuit_voltage(self.charge) - _RESISTANCE * self.current)


def sag(load: float) -> float:
    """Return the voltage drop under a load, V; see `Battery.step`."""
    return _RESISTANCE * _HOVER_CURRENT * load


def open_circuit_voltage(charge: float) -> float:
    """Return the voltage without load, V, at a state of charge from 0 to 1."""
    i = min(int(10.0 * charge), 9)
    low, high = OPEN_CIRCUIT_VOLTAGES[i : i + 2]
    return low + (10.0 * charge - i) * (high - low)


def tip(
    airframe: Airframe, before: Vector[float], after: Vector[float], dt: float
) -> Vector[float]:
    """Return the state of a vehicle on the ground, with the tilt that its feet allow.

    The states before and after a step of ``dt`` s, 17 components, are those of `Airframe.step`,
    which keeps a vehicle upright that stands.
    """
    parameters = airframe.parameters
    roll, pitch, yaw = zyx_from_quaternion(before[6:10])
    thrust, torque_x, torque_y, _ = airframe.wrench(after[13:17])
    load = parameters.mass * GRAVITY - thrust * math.cos(roll) * math.cos(pitch)
    arm = parameters.arm * math.sqrt(0.5)
    hold = max(load, 0.0) * arm
    edge = parameters.mass * arm * arm
    roll, p = _tipped(roll, before[10], torque_x, hold, parameters.inertia_x + edge, dt)
    pitch, q = _tipped(pitch, before[11], torque_y, hold, parameters.inertia_y + edge, dt)
    if not (roll or pitch):
        return after
    attitude = quaternion_from_zyx(roll, pitch, yaw)
    return [*before[0:2], *after[2:6], *attitude, p, q, *after[12:]]


def _tipped(angle, rate, torque, hold, inertia, dt):
    if angle == 0.0 and abs(torque) <= hold:
        return 0.0, 0.0
    side = math.copysign(1.0, angle or torque)
    rate += (torque - side * hold * math.cos(angle)) / inertia * dt
    tipped = angle + rate * dt
    # Beyond upright, the other feet touch the ground.
    return (tipped, rate) if tipped * side > 0.0 else (0.0, 0.0)


STEP = PERIOD  #: Step of the integration, s: that of the firmware's attitude controller.


class MotorCommands(NamedTuple):
    """Commands of the four motors (PWM)."""

    m1: float
    m2: float
    m3: float
    m4: float


OFF = MotorCommands(0.0, 0.0, 0.0, 0.0)

_OVERTURNING = 0.5  #: Cosine of the tilt on the ground beyond which a vehicle lies on its back.


#: Largest change in a step, of x, y, z and yaw: at 0.5 m/s and 45 degrees/s.
_HAND_STEPS = (0.5 * STEP, 0.5 * STEP, 0.5 * STEP, math.radians(45.0) * STEP)


class Hand:
    """A hand that carries the vehicle; with all values 0 it rests at its pick-up point."""

    def __init__(self) -> None:
        #: x, y, z, yaw: Displacement and turn, m and degrees, in the vehicle's directions at the
        #: pick-up.
        self.x = self.y = self.z = self.yaw = 0.0
        self._start: tuple[Triple, float] | None = None
        self._offset = [0.0] * 4

    def carry(self, x: Vector[float]) -> Vector[float] | None:
        """Return the state of the vehicle after a step, 17 components; None if not held."""
        goal = [self.x, self.y, self.z, math.radians(self.yaw)]
        if not (any(goal) or any(self._offset)):
            self._start = None
            return None
        if self._start is None:
            self._start = (x[0], x[1], x[2]), zyx_from_quaternion(x[6:10])[2]
        steps = [
            clip(g - o, -most, most)
            for g, o, most in zip(goal, self._offset, _HAND_STEPS, strict=True)
        ]
        self._offset = [o + step for o, step in zip(self._offset, steps, strict=True)]
        place, yaw = self._start
        turn = quaternion_from_zyx(0.0, 0.0, yaw)
        position = [a + b for a, b in zip(place, rotate(turn, self._offset[:3]), strict=True)]
        *velocity, turning = (step / STEP for step in steps)
        attitude = quaternion_from_zyx(0.0, 0.0, yaw + self._offset[3])
        return [*position, *rotate(turn, velocity), *attitude, 0.0, 0.0, turning, *x[13:17]]


class _Lags:
    """Motion of a model with lags, which replaces the effect of its rotors and inner loops."""

    def __init__(self, model: QuadrotorParameters):
        self._model = model
        self._dynamics = FirstOrderQuadrotor(model)
        late = round(model.delay / STEP)
        # Delayed controls; the first one acts.
        self._controls: deque[Vector[float]] = deque([[0.0] * 4] * (late + 1), maxlen=late + 1)
        self._yaw_dot = self._root = 0.0

    def step(self, x: Vector[float], desired: Triple, speed: float) -> Vector[float]:
        """Return the state after a step, 17 components.

        ``desired`` is that of `Physics`, ``speed`` the commanded one of each rotor (rad/s).
        """
        model = self._model
        roll, pitch, yaw_dot = desired
        lift = 4.0 * model.thrust_constant / model.mass
        thrust = lift * speed * speed
        self._controls.append([roll - model.roll_trim, pitch - model.pitch_trim, yaw_dot, thrust])
        angles = zyx_from_quaternion(x[6:10])
        y = [*x[:6], *angles, self._yaw_dot, self._root]
        y = rk4_step(self._dynamics.rates, 0.0, y, self._controls[0], STEP)
        y = self._dynamics.apply_ground_contact(y)
        self._yaw_dot, self._root = y[9], y[10]
        attitude = quaternion_from_zyx(y[6], y[7], y[8])
        # Twice the vector part of the rotation of a step, in the body frame, is its angle.
        a, b, c, d = x[6:10]
        *turned, w = product((-a, -b, -c, d), attitude)
        rates = [math.copysign(2.0, w) / STEP * part for part in turned]
        return [*y[:6], *attitude, *rates, *[y[10] / math.sqrt(lift)] * 4]


class Physics:
    """Rigid body, four motors, ground; it begins at a position (m) and heading (rad).

    The errors are the excess of mass and thrust over those of the ``model``, as fractions. A model
    with the lag of roll follows the ``desired`` attitude with its lags, trims and delay, and
    knows neither ground effect nor moving air.
    """

    def __init__(
        self,
        position: Triple = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        mass_error: float = 0.0,
        thrust_error: float = 0.0,
        model: QuadrotorParameters = CRAZYFLIE,
        has_ground_effect: bool = False,
    ):
        self.model = model
        true = model.with_errors(mass_error, thrust_error)
        self._airframe = Airframe(true, ground_effect if has_ground_effect else None)
        #: Air that this vehicle and others move; None for still air.
        self.air: Air | None = None
        self._lags = None if model.roll_lag is None else _Lags(true)
        #: Roll and pitch (rad, nose down) and yaw rate (rad/s) that the controllers ask for.
        self.desired: Triple = (0.0, 0.0, 0.0)
        x = self._airframe.initial_state([float(part) for part in position])
        x[6:10] = [0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)]
        x[13:17] = [0.0] * 4
        self._x = x
        #: Acceleration that an accelerometer measures, body frame (m/s^2).
        self.specific_force: Triple = (0.0, 0.0, GRAVITY)
        #: World that ranging sensors see; None for the ground alone. The vehicle collides with the
        #: ground only.
        self.world: World | None = None
        self.hand = Hand()
        #: Whether it has come down on its back, where it lies until `put_upright`.
        self.is_overturned = False

    @property
    def has_lags(self) -> bool:
        """Whether it follows `desired` instead of its rotors."""
        return self._lags is not None

    @property
    def position(self) -> Triple:
        """m, fixed frame."""
        x, y, z = self._x[0:3]
        return x, y, z

    @property
    def velocity(self) -> Triple:
        """m/s, fixed frame."""
        x, y, z = self._x[3:6]
        return x, y, z

    @property
    def quaternion(self) -> Quaternion:
        """(x, y, z, w), body to fixed frame."""
        x, y, z, w = self._x[6:10]
        return x, y, z, w

    @property
    def rates(self) -> Triple:
        """Body rates, rad/s."""
        x, y, z = self._x[10:13]
        return x, y, z

    @property
    def rotor_speeds(self) -> Vector[float]:
        """rad/s, of each rotor."""
        return self._x[13:17]

    @property
    def load(self) -> float:
        """Mean of the third powers of the rotor speeds over the hover speed's."""
        return sum((speed / self.model.hover_speed) ** 3 for speed in self.rotor_speeds) / 4.0

    def put_upright(self) -> None:
        """Put the vehicle upright on the ground."""
        self.is_overturned = False
        self.specific_force = (0.0, 0.0, GRAVITY)

    def step(self, commands: MotorCommands, voltage: float) -> None:
        """Advance by `STEP`; the battery's voltage (V) limits the speed of the motors."""
        top = self.model.max_rotor_speed * voltage / FULL_VOLTAGE
        before = self._x
        if (carried := self.hand.carry(before)) is not None:
            self._x, self.specific_force = carried, (0.0, 0.0, GRAVITY)
            return
        if self.is_overturned:
            commands = OFF
        if self._lags is not None:
            speed = min(top, self.model.rotor_speed(sum(commands) / 4.0))
            after = self._lags.step(before, self.desired, speed)
        else:
            speeds = [min(top, self.model.rotor_speed(command)) for command in commands]
            wind = STILL_AIR
            if self.air is not None:
                thrust = self._airframe.wrench(before[13:17])[0]
                wind = 0.0, 0.0, -self.air.move(self, self.position, thrust)
            after = self._airframe.step(0.0, before, speeds, wind, STEP)
            if after[2] <= 0.0:
                after = tip(self._airframe, before, after, STEP)
        self._x = after
        if after[2] <= 0.0 and not self.is_overturned:
            up = 1.0 - 2.0 * (before[6] ** 2 + before[7] ** 2)
            self.is_overturned = up < _OVERTURNING
        if self.is_overturned:
            self.specific_force = (0.0, 0.0, -GRAVITY)
            return
        force = (
            (after[3] - before[3]) / STEP,
            (after[4] - before[4]) / STEP,
            (after[5] - before[5]) / STEP + GRAVITY,
        )
        self.specific_force = rotate_back(after[6:10], force)


#: Reading of a sensor of the Multi-ranger without an object in its range (mm), and that range (m).
NOTHING = 32767
_REACH = 4.0
#: Largest raw reading of the sensor down (mm), which the firmware passes on; its own estimator does
#: not use 5,000 and more.
MAX_RAW = 8190

#: Log variable -> direction of its sensor, body frame.
_DIRECTIONS: dict[str, Triple] = {
    "front": (1.0, 0.0, 0.0),
    "back": (-1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0),
    "zrange": (0.0, 0.0, -1.0),
}


class RangingSensors:
    """Distances, mm, as whole numbers; 0 without a sensor.

    A Multi-ranger has sensors to all sides and up, a Flow deck has one down.
    """

    def __init__(self, physics: Physics, has_multiranger: bool, has_flow_deck: bool):
        self._physics = physics
        self.has_multiranger = has_multiranger
        self.has_flow_deck = has_flow_deck

    def distance(self, side: str) -> int:
        """Return the reading of the sensor of a log variable (of the group ``range``), mm."""
        if not (self.has_flow_deck if side == "zrange" else self.has_multiranger):
            return 0
        direction = rotate(self._physics.quaternion, _DIRECTIONS[side])
        distance = self._distance(direction)
        if side == "zrange":
            return round(min(1000.0 * distance, MAX_RAW))
        return round(1000.0 * distance) if distance < _REACH else NOTHING

    def _distance(self, direction: Triple) -> float:
        physics = self._physics
        if physics.world is not None:
            return float(physics.world.cast(physics.position, direction)[0])
        height, fall = physics.position[2], -direction[2]
        return height / fall if fall > 0.0 else math.inf


#: Standard deviation of a sample, deg/s: the BMI088's noise density, 0.014 deg/s/sqrt(Hz) [data
#: sheet], in the firmware's bandwidth of about 50 Hz.
_GYRO_NOISE = 0.1

#: Standard deviation of a sample, g: 190 ug/sqrt(Hz) [data sheet] in about 100 Hz.
_ACCELEROMETER_NOISE = 0.002
_BAROMETER_NOISE = 0.05  #: Standard deviation of the height, m.
_ACCELEROMETER_RANGE = 24.0  #: g.
_GYRO_RANGE = 2000.0  #: deg/s.
#: Magnetic field, gauss, fixed frame: central Europe, with x to the north.
_FIELD = (0.2, 0.0, -0.43)
_SEA_LEVEL_PRESSURE = 1013.25  #: mbar.

_NOISE_SAMPLES = 8191


class Sensors:
    """Inertial sensors, barometer and magnetometer; ``seed`` is that of their noise."""

    def __init__(self, noise: bool = True, seed: int = 0):
        source = random.Random(seed)
        # Drawing six numbers 500 times a second would cost more than the
        # controllers; a prime number of samples does not repeat in step.
        self._noise = [source.gauss(0.0, 1.0) if noise else 0.0 for _ in range(_NOISE_SAMPLES)]
        self._next = 0
        self.gyro_x = self.gyro_y = self.gyro_z = 0.0  #: deg/s, body frame (forward-left-up).
        self.acc_x, self.acc_y, self.acc_z = 0.0, 0.0, 1.0  #: g, body frame; (0, 0, 1) at rest.
        self.mag_x, self.mag_y, self.mag_z = _FIELD  #: gauss, body frame.
        #: asl, pressure, temperature: Height above sea level in m, mbar, degrees Celsius.
        self.asl = 0.0
        self.pressure = _SEA_LEVEL_PRESSURE
        self.temperature = 25.0

    def sample_inertial(self, rates: Triple, specific_force: Triple) -> None:
        """Measure body rates, rad/s, and acceleration without gravity's, m/s^2, body frame."""
        start = self._next
        self._next = start + 6 if start + 12 <= _NOISE_SAMPLES else (start + 6) % 7
        n = self._noise[start : start + 6]
        self.gyro_x = clip(math.degrees(rates[0]) + _GYRO_NOISE * n[0], -_GYRO_RANGE, _GYRO_RANGE)
        self.gyro_y = clip(math.degrees(rates[1]) + _GYRO_NOISE * n[1], -_GYRO_RANGE, _GYRO_RANGE)
        self.gyro_z = clip(math.degrees(rates[2]) + _GYRO_NOISE * n[2], -_GYRO_RANGE, _GYRO_RANGE)
        limit, sigma = _ACCELEROMETER_RANGE, _ACCELEROMETER_NOISE
        self.acc_x = clip(specific_force[0] / GRAVITY + sigma * n[3], -limit, limit)
        self.acc_y = clip(specific_force[1] / GRAVITY + sigma * n[4], -limit, limit)
        self.acc_z = clip(specific_force[2] / GRAVITY + sigma * n[5], -limit, limit)

    def sample_slow(self, height: float, quaternion: Quaternion) -> None:
        """Measure pressure and magnetic field at a height (m) and an attitude (x, y, z, w)."""
        self.mag_x, self.mag_y, self.mag_z = rotate_back(quaternion, _FIELD)
        self.asl = height + _BAROMETER_NOISE * self._noise[self._next]
        # International standard atmosphere.
        self.pressure = _SEA_LEVEL_PRESSURE * (1.0 - 2.25577e-5 * self.asl) ** 5.25588
