"""A flight from the ground to a goal and back, as a state machine.

Times are s of any monotonic clock; after a reset of the clock, a manoeuvre continues.
"""

import math
from enum import Enum

from crazyflie_controller.go_to import GoToController, GoToSetpoint, HeadingPose
from crazyflie_model.limits import HOLD_LIMIT, OFF_AGE
from crazyflie_model.units import GRAVITY, HOVER_PWM
from crazyflie_utils.refusal import RefusalError

TAKEOFF_RATE = 10000.0  #: Rate of the thrust in a takeoff, PWM/s.
#: Height above the start, m, at which a takeoff ends, and a landing's last part begins.
LIFT_OFF_HEIGHT = 0.05

LIFT_OFF_EXCESS = TAKEOFF_RATE * (6.0 * LIFT_OFF_HEIGHT * HOVER_PWM / (GRAVITY * TAKEOFF_RATE)) ** (
    1.0 / 3.0
)
"""Thrust beyond that of hover when a vehicle has reached `LIFT_OFF_HEIGHT`, PWM.

With a thrust that grows at a constant rate it climbs by g rate t^3 / (6 hover), so that
the time since it left the ground depends on its weight by the cube root only."""

HOVER_HEIGHT = 0.5  #: Height above the start at which a vehicle hovers before the first goal (m).
DESCENT_SPEED = 0.3  #: Speed of a landing, m/s.

#: Depth of a landing's last goal below the start, m, so that the vehicle touches down with the
#: speed of the descent also when it flies above the goal.
PRESS_DEPTH = 0.3

#: Longest delay of a descent over its calculated duration, s: the floor may be higher there.
DESCENT_MARGIN = 3.0
TOUCHDOWN_RATE = 20000.0  #: Rate of the decreasing thrust in the last part of a landing, PWM/s.
TOUCHDOWN_DURATION = 1.0  #: Duration of that part, s; zero thrust follows.


class State(Enum):
    """States of the controller, as its messages name them."""

    IDLE = "idle"
    TAKING_OFF = "taking off"
    AUTOMATIC = "automatic"
    LANDING = "landing"
    TOUCHING_DOWN = "touching down"


class GoToFlight:
    """One vehicle's flights.

    Without a new pose within `HOLD_LIMIT`, a vehicle in the air gets no setpoints, so that its own
    watchdog levels it out. After `OFF_AGE` its motors are off, and the flight has ended.
    """

    def __init__(self, controller: GoToController):
        self._controller = controller
        self.state = State.IDLE  #: After the last tick or command.
        self._warning: str | None = None
        self.goal: HeadingPose | None = None  #: Goal of this flight, or of the next one.
        # Never used before the first pose.
        self._pose = self._hover = self._descent_start = HeadingPose(0.0, 0.0, 0.0, 0.0)
        self._stamp: float | None = None
        self._pose_time = -math.inf
        self._time = -math.inf
        self._entered = -math.inf
        self._interval: float | None = None
        self._setpoint: GoToSetpoint | None = GoToSetpoint()
        self._ground = 0.0
        self._descent_speed = DESCENT_SPEED
        self._touchdown_thrust = 0.0

    def take_warning(self) -> str | None:
        """Return the warning of the last tick, once; or None."""
        warning, self._warning = self._warning, None
        return warning

    def take_off(self) -> None:
        """Start a takeoff; `RefusalError` if the vehicle is in flight, or without a new pose."""
        if self.state is not State.IDLE:
            raise RefusalError(f"the controller is {self.state.value}; land first")
        if self._is_pose_older_than(HOLD_LIMIT):
            raise RefusalError(f"there has been no new pose for {HOLD_LIMIT:g} s")
        self._ground = self._pose.z
        self._enter(State.TAKING_OFF)

    def land(self) -> None:
        """Start a landing at the vehicle's position; `RefusalError` on the ground or in one."""
        if self.state is State.TAKING_OFF:
            self._touch_down()
        elif self.state is State.AUTOMATIC:
            self._descent_start, self._descent_speed = self._pose, DESCENT_SPEED
            self._enter(State.LANDING)
        else:
            raise RefusalError(f"the controller is {self.state.value}")

    def land_within(self, limit: float) -> None:
        """Speed a descent up to end within a time (s); other states are not affected."""
        if self.state is State.LANDING:
            self._descent_start = self._descent_start._replace(z=self._pose.z)
            self._descent_speed = max(DESCENT_SPEED, (self._pose.z - self._ground) / limit)
            self._enter(State.LANDING)

    def tick(
        self, time: float, stamp: float | None, pose: HeadingPose | None
    ) -> GoToSetpoint | None:
        """Return the setpoint for a time (s); None leaves the vehicle to its own watchdog.

        The pose is the latest one, or None. Its stamp is in s of any clock; the same
        stamp is the same pose.
        """
        self._follow_clock(time)
        self._update_pose(stamp, pose)
        self._setpoint = self._ACTIONS[self.state](self)
        return self._setpoint

    # One action for each state.

    def _idle(self):
        return GoToSetpoint()

    def _take_off(self):
        thrust = TAKEOFF_RATE * (self._time - self._entered)
        if self._is_pose_older_than(HOLD_LIMIT):
            return self._abort(f"takeoff ended: no new pose for {HOLD_LIMIT:g} s")
        if self._pose.z > self._ground + LIFT_OFF_HEIGHT:
            self._hover = self._pose._replace(z=self._ground + HOVER_HEIGHT)
            self._controller.reset(thrust - LIFT_OFF_EXCESS)
            self._enter(State.AUTOMATIC)
            return self._go()
        if thrust >= self._controller.max_thrust:
            return self._abort(f"takeoff ended: not lifted off with a thrust of {thrust:.0f} PWM")
        return GoToSetpoint(thrust=thrust)

    def _go(self):
        return self._fly_to(self._hover if self.goal is None else self.goal)

    def _land(self):
        elapsed = self._time - self._entered
        start = self._descent_start
        lowest = min(self._ground - PRESS_DEPTH, start.z)
        limit = max(start.z - self._ground, 0.0) / self._descent_speed + DESCENT_MARGIN
        if self._pose.z > self._ground + LIFT_OFF_HEIGHT and elapsed <= limit:
            z = max(start.z - self._descent_speed * elapsed, lowest)
            return self._fly_to(start._replace(z=z))
        self._touch_down()
        return self._sink()

    def _sink(self):
        elapsed = self._time - self._entered
        if elapsed >= TOUCHDOWN_DURATION:
            self._enter(State.IDLE)
            return GoToSetpoint()
        return GoToSetpoint(thrust=max(self._touchdown_thrust - TOUCHDOWN_RATE * elapsed, 0.0))

    _ACTIONS = {
        State.IDLE: _idle,
        State.TAKING_OFF: _take_off,
        State.AUTOMATIC: _go,
        State.LANDING: _land,
        State.TOUCHING_DOWN: _sink,
    }

    def _fly_to(self, goal):
        if self._is_pose_older_than(OFF_AGE):
            return self._abort(
                f"flight ended: no new pose for {OFF_AGE:g} s, so that the vehicle has "
                "stopped its motors"
            )
        if self._is_pose_older_than(HOLD_LIMIT):
            self._warning = f"no new pose for {HOLD_LIMIT:g} s: sending no setpoints"
            return None
        if self._interval is None:
            return self._setpoint
        return self._controller.update(self._pose, goal, self._interval)

    def _abort(self, warning):
        self._warning = warning
        self._enter(State.IDLE)
        return GoToSetpoint()

    def _touch_down(self):
        self._touchdown_thrust = 0.0 if self._setpoint is None else self._setpoint.thrust
        self._enter(State.TOUCHING_DOWN)

    def _enter(self, state):
        self.state = state
        self._entered = self._time

    # Poses and clock.

    def _update_pose(self, stamp, pose):
        self._interval = None
        if pose is None or stamp == self._stamp:
            return
        interval = math.inf if self._stamp is None else stamp - self._stamp
        if not 0.0 < interval <= HOLD_LIMIT:
            self._controller.restart_derivatives()
            interval = 0.0
        self._interval = interval
        self._stamp, self._pose, self._pose_time = stamp, pose, self._time

    def _is_pose_older_than(self, limit):
        return self._time - self._pose_time > limit

    def _follow_clock(self, time):
        if time < self._time:
            step = time - self._time
            self._pose_time += step
            self._entered += step
        self._time = time
