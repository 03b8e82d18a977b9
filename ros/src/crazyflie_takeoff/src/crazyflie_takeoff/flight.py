"""Takeoff and landing as a state machine that lives by calls of `FlightStateMachine.tick`.

Heights and positions are in the fixed frame (z up), m. Times are s of any clock
that does not run backwards; if it is reset, what was under way goes on from there.
"""

import math
from dataclasses import dataclass

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.descent import Descent, Position
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_utils.refusal import RefusalError

LIFT_OFF_THRUST = GRAVITY + 0.2
"""Thrust of the open-loop part of a takeoff, m/s^2."""

RAMP_RATE = 5.0
"""How fast the thrust of a landing goes down from hover, m/s^2 per s."""

RAMP_DURATION = 1.0
"""How long the ramp lasts, s; zero thrust follows."""

ZERO_THRUST_PERIOD = 0.1
"""Period at which zero thrust is repeated on the ground, s."""

TOUCHDOWN_HEIGHT = 0.05
"""A vehicle less than this above the ground counts as down, m."""

LIFT_OFF_TIME = 3.0
"""A vehicle that is still down although a controller has had so long to lift it, s, cannot fly."""

TOUCHDOWN_LIMIT = 2.0
"""How long after the ramp a vehicle may take to come down, s."""

SHORTEST_DESCENT = 1.0
"""A descent that has to end within a time takes at least this, s, however late it is."""

FILTER_LIMIT = 60.0
"""How long the filter may take to bring a vehicle down, or hold it, s."""

_ROUNDING = 1e-6
"""Tolerance of comparisons between times, s."""

_REFUSALS = {
    FlightState.ON_GROUND: "the vehicle is on the ground",
    FlightState.TAKING_OFF: "a takeoff is under way",
    FlightState.FLYING: "the vehicle is in flight; land first",
    FlightState.DESCENDING: "a landing is under way",
    FlightState.LANDING: "a landing is under way",
}


@dataclass(frozen=True)
class Plan:
    """How to take off and land.

    Attributes
    ----------
    hover : tuple of float
        Hover point x, y, z, m.
    open_loop : float
        How long `LIFT_OFF_THRUST` is given, s.
    settle : float
        How long the controller has to reach the hover point, s.
    descent_speed : float
        Speed of the descent, m/s; 0 for none: a landing is the bare ramp.
    """

    hover: Position
    open_loop: float
    settle: float
    descent_speed: float


@dataclass(frozen=True)
class Output:
    """What is to be published after a tick.

    Attributes
    ----------
    state : FlightState
    thrust : float or None
        Takeoff control with level attitude, m/s^2.
    reference : tuple or None
        x, y, z in m and x_dot, y_dot, z_dot in m/s.
    toggle : bool
        in_flight changes.
    """

    state: FlightState
    thrust: float | None = None
    reference: tuple[float, ...] | None = None
    toggle: bool = False


class FlightStateMachine:
    """The vehicle's flight, from the ground to the ground.

    Attributes
    ----------
    plan : Plan
        May be replaced at any time; what has begun already goes on as it was planned.
    is_held : bool
        Whether the filter keeps the vehicle level because no control comes. A descent waits
        then: either control comes back, or the filter brings the vehicle down.

    Parameters
    ----------
    plan : Plan
    state : FlightState
        Where the flight stands; not TAKING_OFF.
    announced : bool, optional
        Whether the world has been told (by toggles) that the vehicle is in
        flight. By default it has been told the truth.
    is_lost : bool, optional
        Whether the filter is bringing the vehicle down; see `lose`.
    ground : float, optional
        z of the ground until a vehicle is seen on it, m.
    """

    def __init__(
        self,
        plan: Plan,
        state: FlightState = FlightState.ON_GROUND,
        announced: bool | None = None,
        is_lost: bool = False,
        ground: float = 0.0,
    ):
        self.plan = plan
        self.is_held = False
        self._state = state
        self._announced = state.in_flight if announced is None else announced
        self._ground = ground
        self._time = -math.inf
        self._entered: float | None = None
        self._hover_sent = False
        # Where the vehicle is, measured or, in a descent, dead-reckoned; None until it is measured.
        self._position: Position | None = None
        self._is_seen = False
        self._descent: Descent | None = None
        self._descent_speed = plan.descent_speed
        self._descent_limit = math.inf
        self._zero_sent = -math.inf
        self._is_lost = is_lost

    @property
    def state(self) -> FlightState:
        """Where the flight stands."""
        return self._state

    @property
    def ground(self) -> float:
        """Height (z) of the ground, where the vehicle stood before it took off, m."""
        return self._ground

    def check_takeoff(self) -> None:
        """Raise a `RefusalError` when the vehicle is not on the ground."""
        if self._state is not FlightState.ON_GROUND:
            raise RefusalError(_REFUSALS[self._state])

    def takeoff(self) -> None:
        """Begin to take off.

        Raises
        ------
        RefusalError
            The vehicle is not on the ground.
        """
        self.check_takeoff()
        self._enter(FlightState.TAKING_OFF)

    @property
    def may_land(self) -> bool:
        """Whether `land` makes sense."""
        return self._state in (FlightState.FLYING, FlightState.TAKING_OFF)

    def land(self) -> None:
        """Begin to land.

        Raises
        ------
        RefusalError
            The vehicle is on the ground, or landing already.
        """
        if not self.may_land:
            raise RefusalError(_REFUSALS[self._state])
        self._enter(self._way_down())

    def hurry(self, within: float) -> None:
        """Have a descent that is under way end within a time, s; anything else goes on as it is."""
        if self._state is FlightState.DESCENDING:
            elapsed = 0.0 if self._entered is None else self._time - self._entered
            self._descent_limit = elapsed + within
            self._descent = None

    def abort(self) -> None:
        """Turn a takeoff into a landing; anything else goes on as it is."""
        if self._state is FlightState.TAKING_OFF:
            self._enter(self._way_down())

    def lose(self) -> None:
        """Leave a vehicle that is not on the ground to the filter, which brings it down."""
        if self._state is not FlightState.ON_GROUND and not self._is_lost:
            self._enter(FlightState.LANDING)
            self._is_lost = True

    def regain(self) -> None:
        """Go on with the landing of a vehicle that the filter has given up."""
        if self._is_lost:
            self._enter(FlightState.LANDING)

    def end(self) -> None:
        """Take note that the motors are off."""
        if self._state is not FlightState.ON_GROUND:
            self._enter(FlightState.ON_GROUND)

    def tick(self, time: float, position: Position | None = None) -> Output:
        """Go on.

        Parameters
        ----------
        time : float
            Now, s.
        position : tuple of float or None
            Measured x, y, z, m; None when it is not known at present.

        Returns
        -------
        Output
        """
        self._follow_clock(time)
        if position is not None:
            self._position = position
        thrust, reference = self._ACTIONS[self._state](self, time, position)
        self._is_seen = position is not None
        toggle = self._state.in_flight != self._announced
        self._announced = self._state.in_flight
        return Output(self._state, thrust, reference, toggle)

    # One action for each state: it returns thrust and reference, or None for them.

    def _stay_on_ground(self, time, position):
        if position is not None:
            self._ground = position[2]
        return self._zero_thrust(time), None

    def _take_off(self, time, position):
        elapsed = time - self._entered + _ROUNDING
        if elapsed < self.plan.open_loop:
            return LIFT_OFF_THRUST, None
        reference = None
        if not self._hover_sent:
            self._hover_sent = True
            reference = (*self.plan.hover, 0.0, 0.0, 0.0)
        if elapsed >= self.plan.open_loop + self.plan.settle:
            self._enter(FlightState.LANDING if self._stays_down(position) else FlightState.FLYING)
        return None, reference

    def _fly(self, time, position):
        return None, None

    def _descend(self, time, position):
        elapsed = time - self._entered
        is_seen_again = position is not None and not self._is_seen
        waits = self.is_held and elapsed < FILTER_LIMIT
        if self._position is not None and (self._descent is None or is_seen_again or waits):
            self._descent = self._descend_from(self._position, elapsed)
        descent = self._descent
        if descent is None or self._is_down(position) or descent.is_over(elapsed):
            self._enter(FlightState.LANDING)
            self._follow_clock(time)
            return self._ramp_down(time, position)
        reference = descent.reference(elapsed)
        if position is None:
            self._position = reference[:3]
        return None, reference

    def _descend_from(self, position, elapsed):
        remaining = max(self._descent_limit - elapsed, SHORTEST_DESCENT)
        speed = max(self._descent_speed, (position[2] - self._ground) / remaining)
        return Descent(elapsed, position, self._ground, speed)

    def _ramp_down(self, time, position):
        elapsed = time - self._entered + _ROUNDING
        if self._is_lost and elapsed < FILTER_LIMIT:
            return None, None
        if elapsed < RAMP_DURATION:
            return GRAVITY - RAMP_RATE * (time - self._entered), None
        # The motors are off already: without a height there is nothing to wait for.
        is_known = position is not None
        if not is_known or self._is_down(position) or elapsed > RAMP_DURATION + TOUCHDOWN_LIMIT:
            self._enter(FlightState.ON_GROUND)
        return self._zero_thrust(time), None

    _ACTIONS = {
        FlightState.ON_GROUND: _stay_on_ground,
        FlightState.TAKING_OFF: _take_off,
        FlightState.FLYING: _fly,
        FlightState.DESCENDING: _descend,
        FlightState.LANDING: _ramp_down,
    }

    def _enter(self, state):
        self._state = state
        self._entered = None
        self._hover_sent = False
        self._descent = None
        self._descent_speed = self.plan.descent_speed
        self._descent_limit = math.inf
        self._zero_sent = -math.inf
        self._is_lost = False

    def _follow_clock(self, time):
        if self._entered is None:
            self._entered = time
        elif time < self._time:
            self._entered += time - self._time
            self._zero_sent += time - self._time
        self._time = time

    def _way_down(self):
        return FlightState.DESCENDING if self.plan.descent_speed > 0.0 else FlightState.LANDING

    def _is_down(self, position):
        return position is not None and position[2] - self._ground < TOUCHDOWN_HEIGHT

    def _stays_down(self, position):
        return self.plan.settle >= LIFT_OFF_TIME and self._is_down(position)

    def _zero_thrust(self, time):
        if time - self._zero_sent < ZERO_THRUST_PERIOD - _ROUNDING:
            return None
        self._zero_sent = time
        return 0.0
