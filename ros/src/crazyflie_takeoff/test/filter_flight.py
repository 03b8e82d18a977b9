"""A filter in closed loop with a vehicle that moves up and down, with a clock moved by hand."""

from random import Random

from takeoff_helpers import PointMass

from crazyflie_takeoff.filter_machine import FilterMachine, FilterState, LossTimeouts
from crazyflie_takeoff.limits import Box, Limits
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.safe_control import SafeSetpoint
from crazyflie_takeoff.transition_table import FlightState

G = 9.81
ON_GROUND, TAKING_OFF, FLYING, DESCENDING, LANDING = FlightState
LIMITS = Limits(Box((-2.0, -2.0, -1.0), (2.0, 2.0, 3.0)), 0.5, -0.5, 3.0, 10.0)
TIMEOUTS = LossTimeouts(0.1, 0.5, 5.0, 3.0)


def level(thrust):
    return SafeSetpoint(0.0, 0.0, 0.0, thrust)


class Flight:
    """A filter above a vehicle, whose true hover thrust is not what it is believed to be."""

    def __init__(
        self, height=1.0, hover=G, speed=0.0, sees=True, with_state=True, limits=LIMITS, noise=0.0
    ):
        self.filter = FilterMachine(TIMEOUTS, limits)
        self.vehicle = PointMass(height)
        self.vehicle.z_dot = speed
        self.hover = hover
        self.ticks = 0
        self.controls = True
        self.sees = sees
        self.noise, self.random = noise, Random(1)  # Of the measured z_dot (m/s).
        self.target = speed
        self.flown = []
        self.filter.stop_listening(0.0)
        if with_state:
            self.filter.flight_state = FLYING
        self.fly(level(hover))

    @property
    def time(self):
        return 50.0 + self.ticks / 100

    def fly(self, control):
        if isinstance(control, (SafeSetpoint, float)):
            thrust = control.thrust if isinstance(control, SafeSetpoint) else control
            self.flown.append(thrust)
            # The point mass knows g only.
            self.vehicle.command(thrust - self.hover + G if thrust > 0.0 else 0.0)

    def run(self, duration):
        """Advance the time; the controller keeps its vertical speed."""
        for _ in range(round(duration * 100)):
            self.ticks += 1
            self.vehicle.advance(0.01)
            if self.sees:
                position = (0.0, 0.0, self.vehicle.z)
                z_dot = self.vehicle.z_dot + self.random.gauss(0.0, self.noise)
                self.filter.measure(Motion(position, (0.0, 0.0, z_dot)))
            if self.controls:
                thrust = self.hover + 2.0 * (self.target - self.vehicle.z_dot)
                self.fly(self.filter.commanded(self.time, thrust, level(thrust)))
            self.fly(self.filter.tick(self.time))
        return self

    def run_until_off(self, limit=30.0):
        start = self.time
        while self.filter.state is not FilterState.DOWN:
            self.run(0.01)
            assert self.time - start < limit
        return self.time - start

    def lose(self, pose=True):
        """Lose the pose, so that neither states nor controls come; or only the controls."""
        self.controls, self.sees = False, not pose
        return self
