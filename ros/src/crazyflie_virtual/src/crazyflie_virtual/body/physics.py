"""The body of the vehicle: the airframe, what is felt in it, and coming down on the back."""

import math
from typing import NamedTuple

from crazyflie_model.angles import Quaternion, Triple, rotate_back
from crazyflie_model.inner_loops import PERIOD
from crazyflie_model.quadrotor import CRAZYFLIE, STILL_AIR, Airframe
from crazyflie_model.units import GRAVITY
from crazyflie_virtual.body.battery import FULL_VOLTAGE
from crazyflie_virtual.body.feet import tip
from crazyflie_world.world import World

STEP = PERIOD  #: Step of the integration, s: that of the firmware's attitude controller.


class MotorCommands(NamedTuple):
    """PWM of the four motors."""

    m1: float
    m2: float
    m3: float
    m4: float


OFF = MotorCommands(0.0, 0.0, 0.0, 0.0)

_OVERTURNING = 0.5  #: Cosine of the tilt on the ground beyond which a vehicle lies on its back.


class Physics:
    """Rigid body, four motors, ground; it begins at a position (m) and heading (rad).

    The errors are how much more mass and thrust the vehicle has than it should, as a fraction.
    """

    def __init__(
        self,
        position: Triple = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        mass_error: float = 0.0,
        thrust_error: float = 0.0,
    ):
        self._airframe = Airframe(CRAZYFLIE.with_errors(mass_error, thrust_error))
        x = self._airframe.initial_state([float(part) for part in position])
        x[6:10] = [0.0, 0.0, math.sin(yaw / 2.0), math.cos(yaw / 2.0)]
        x[13:17] = [0.0] * 4
        self._x = x
        #: What an accelerometer feels, m/s^2, body frame.
        self.specific_force: Triple = (0.0, 0.0, GRAVITY)
        #: What is around it; None for the ground alone, which is also all that it comes to rest on.
        self.world: World | None = None
        self.is_overturned = False  #: Came down on its back: lies there until `put_upright`.

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
    def load(self) -> float:
        """Mean of the third powers of the rotor speeds over the hover speed's."""
        return sum((speed / CRAZYFLIE.hover_speed) ** 3 for speed in self._x[13:17]) / 4.0

    def put_upright(self) -> None:
        """Pick the vehicle up and put it on its feet."""
        self.is_overturned = False
        self.specific_force = (0.0, 0.0, GRAVITY)

    def step(self, commands: MotorCommands, voltage: float) -> None:
        """Advance by `STEP`; the battery's voltage (V) limits the speed of the motors."""
        top = CRAZYFLIE.max_rotor_speed * voltage / FULL_VOLTAGE
        before = self._x
        if self.is_overturned:
            commands = OFF
        speeds = [min(top, CRAZYFLIE.rotor_speed(command)) for command in commands]
        after = self._airframe.step(0.0, before, speeds, STILL_AIR, STEP)
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
