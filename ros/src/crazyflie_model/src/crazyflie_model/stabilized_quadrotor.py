"""The full vehicle: airframe and inner loops behind the interface of all models."""

from collections.abc import Callable, Sequence

from typing_extensions import override

from crazyflie_model import inner_loops
from crazyflie_model.angles import Quaternion, Triple, zyx_from_quaternion
from crazyflie_model.dynamics import STEP, Dynamics
from crazyflie_model.elementwise import Number, Vector, where
from crazyflie_model.quadrotor import BODY_DIM, CRAZYFLIE, STILL_AIR, Airframe, QuadrotorParameters
from crazyflie_model.units import pwm_from_thrust

_STEPS_PER_SAMPLE = round(inner_loops.PERIOD / STEP)


def still_air(t: float) -> Triple:
    """Return the velocity of still air, m/s."""
    return STILL_AIR


class StabilizedQuadrotor(Dynamics):
    """A quadrotor that takes the control (roll, pitch, yaw_dot, thrust) to its motors.

    State: the airframe's (see `quadrotor`), the memory of the inner loops (see `inner_loops`), and
    the four motor speeds commanded last, rad/s. The inner loops sample every second step; between
    samples the latter two stay.

    Thrust is normalised with the *nominal* mass and thrust constant, as is the radio link's: a true
    vehicle, which has more of both by ``mass_error`` and ``thrust_error`` (fractions of the nominal
    ones, > -1), hovers at ``GRAVITY * (1 + mass_error) / (1 + thrust_error)``. Roll and pitch are
    those in the heading frame. ``wind(t)`` is the velocity of the air (3 components) at time t (s),
    m/s, fixed frame.
    """

    x_dim = BODY_DIM + inner_loops.MEMORY_DIM + 4

    def __init__(
        self,
        parameters: QuadrotorParameters = CRAZYFLIE,
        mass_error: float = 0.0,
        thrust_error: float = 0.0,
        wind: Callable[[float], Triple] = still_air,
    ):
        self.airframe = Airframe(parameters.with_errors(mass_error, thrust_error))
        self._nominal = parameters
        # The default type uses the link's own conversion, which is the same and faster.
        self._pwm = pwm_from_thrust if parameters == CRAZYFLIE else parameters.pwm
        self._wind = wind

    def initial_state(self, position: Sequence[Number]) -> Vector[Number]:
        """See `Dynamics.initial_state`; in the air the rotors carry the vehicle."""
        body = self.airframe.initial_state(position)
        return body + inner_loops.initial_memory(0.0) + body[-4:]

    def rates(self, t: float, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.rates`: of continuous states; others are constant between samples."""
        body = self.airframe.rates(t, x[:BODY_DIM], x[-4:] + [*self._wind(t)])
        return body + [0.0] * (self.x_dim - BODY_DIM)

    def apply_ground_contact(self, x: Vector[Number]) -> Vector[Number]:
        """See `Dynamics.apply_ground_contact` and `Airframe.apply_ground_contact`."""
        return self.airframe.apply_ground_contact(x[:BODY_DIM]) + x[BODY_DIM:]

    @override
    def pose(self, x: Sequence[float], u: Sequence[float]) -> tuple[Triple, Quaternion]:
        return (x[0], x[1], x[2]), (x[6], x[7], x[8], x[9])

    @override
    def step(self, count: int, x: Vector[Number], u: Vector[Number]) -> Vector[Number]:
        body, memory, commands = x[:BODY_DIM], x[BODY_DIM:-4], x[-4:]
        if count % _STEPS_PER_SAMPLE == 0:
            memory, commands = self._sample(body, memory, u)
        t = count * STEP
        body = self.airframe.step(t, body, commands, self._wind(t), STEP)
        return body + memory + commands

    def _sample(self, body, memory, u):
        attitude = zyx_from_quaternion(body[6:10])
        # A real vehicle rocks on its feet until its loops have settled. This one
        # is held upright, so its loops are reset: they would wind up.
        standing = body[2] <= 0.0
        resting = inner_loops.initial_memory(attitude[2])
        memory = [where(standing, a, b) for a, b in zip(resting, memory, strict=True)]
        setpoint = [where(standing, 0.0, part) for part in u[:3]] + [u[3]]
        memory, pwm = inner_loops.update(memory, setpoint, attitude, body[10:13], self._pwm)
        return memory, [self._nominal.rotor_speed(motor) for motor in pwm]
