"""A filter in closed loop with a vehicle that moves up and down, with a clock moved by hand."""

import math
from random import Random

from takeoff_helpers import PointMass

from crazyflie_takeoff import supervisor
from crazyflie_takeoff.envelope import Box, Limits
from crazyflie_takeoff.facts import Facts, Timeouts
from crazyflie_takeoff.fallback import SafeSetpoint
from crazyflie_takeoff.guards import Memory
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.phases import FilterState, FlightState, Phase
from crazyflie_takeoff.supervisor import Given

G = 9.81
ON_GROUND, TAKING_OFF, FLYING, DESCENDING, LANDING = FlightState
LIMITS = Limits(Box((-2.0, -2.0, -1.0), (2.0, 2.0, 3.0)), 0.5, -0.5, 3.0, 10.0)
TIMEOUTS = Timeouts(0.1, 0.5, 5.0, 3.0)


def level(thrust):
    return SafeSetpoint(0.0, 0.0, 0.0, thrust)


def at(z, z_dot=0.0, x=0.0):
    return Motion((x, 0.0, z), (0.0, 0.0, z_dot))


class Supervised:
    """A supervisor with its facts, which is told of one thing after another."""

    def __init__(self, timeouts=TIMEOUTS, limits=LIMITS, sees=False, vehicle=None):
        self.facts = Facts(timeouts, limits, sees, vehicle)
        self.memory = Memory()

    def stop_listening(self, time):
        self.facts.advance(time)
        self.facts.has_listened = True
        waits = self.memory.phase is Phase.LISTENING and self.facts.is_commanded
        given = Given.COMMANDED if waits else Given.TIME
        return supervisor.step(self.memory, self.facts, given)

    def takeoff(self, time, control, setpoint, caller=""):
        stands = supervisor.is_on_ground(self.memory, self.facts)
        self.facts.hear_takeoff(time, control, setpoint, caller, stands)
        return supervisor.step(self.memory, self.facts, Given.TAKEOFF)

    def commanded(self, time, control, setpoint, caller="", age=0.0):
        self.facts.hear_commanded(time, control, setpoint, caller, age)
        return supervisor.step(self.memory, self.facts, Given.COMMANDED)

    def pass_unchanged(self, time, control, age=0.0):
        return supervisor.passes(self.memory, self.facts, time, control, age)

    def tick(self, time):
        self.facts.advance(time)
        return supervisor.step(self.memory, self.facts, Given.TIME)

    def measure(self, motion, age=0.0, time=None):
        now = self.facts.now if time is None else time
        supervisor.measure(self.memory, self.facts, now, motion, age)

    def toggle(self):
        if self.memory.phase.follows or self.state is FilterState.HOLDING:
            self.facts.toggled = not self.facts.toggled
            self.memory.clear_until = -math.inf

    @property
    def flight_state(self):
        return self.facts.flight

    @flight_state.setter
    def flight_state(self, state):
        self.facts.hear_flight(self.facts.now, state)
        self.memory.clear_until = -math.inf

    def stop(self, reason):
        self.facts.emergency = reason
        supervisor.judge(self.memory, self.facts)

    def reset(self):
        supervisor.reset(self.memory, self.facts)

    @property
    def state(self):
        return self.memory.phase.state

    @property
    def reason(self):
        return self.memory.reason

    @property
    def is_nominal(self):
        return supervisor.may_look_rarely(self.memory, self.facts)


class Flight:
    """A filter above a vehicle, whose true hover thrust is not what it is believed to be."""

    def __init__(
        self, height=1.0, hover=G, speed=0.0, sees=True, with_state=True, limits=LIMITS, noise=0.0
    ):
        self.filter = Supervised(TIMEOUTS, limits)
        self.vehicle = PointMass(height)
        self.vehicle.z_dot = speed
        self.hover = hover
        self.ticks = 0
        self.controls = True
        self.sees = sees
        self.noise, self.random = noise, Random(1)  # Of the measured z_dot (m/s).
        self.target = speed
        self.flown = []
        self.filter.stop_listening(self.time)
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
                self.filter.measure(Motion(position, (0.0, 0.0, z_dot)), time=self.time)
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
