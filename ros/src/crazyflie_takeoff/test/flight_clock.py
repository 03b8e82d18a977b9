"""A flight with a clock that is moved by hand."""

from crazyflie_takeoff.phases import FlightState
from crazyflie_takeoff.profiles import TakeoffPlan
from crazyflie_takeoff.server_table import FlightStateMachine, Request, ServerState

G = 9.81
PLAN = TakeoffPlan(hover=(0.1, 0.2, 1.0), open_loop=1.0, settle=5.0, descent_speed=0.3)
BARE = TakeoffPlan(hover=(0.1, 0.2, 1.0), open_loop=1.0, settle=5.0, descent_speed=0.0)

ON_GROUND, TAKING_OFF, FLYING, DESCENDING, LANDING = FlightState


def grounded(plan=PLAN):
    """Return a flight that has not begun."""
    return FlightStateMachine(plan, ServerState.ON_GROUND)


class Clock:
    """Ticks a flight every 10 ms and keeps what it puts out, by time from now."""

    def __init__(self, flight, position=None, start=1000.0):
        self.flight = flight
        self.position = position
        self.ticks = 0
        self.start = start
        self.said = []
        self.states = []

    def run(self, duration):
        """Tick for a time, s; return self."""
        for _ in range(round(duration / 0.01)):
            self.said.append((self.ticks / 100, self.tick()))
        return self

    def run_until(self, state, limit=20.0):
        """Tick until a state is reached; return the time."""
        while self.flight.flight_state is not state:
            self.run(0.01)
            assert self.ticks < limit * 100, f"{state} was not reached"
        return self.said[-1][0]

    def tick(self):
        """Tick once, 10 ms after the last time."""
        output = self.flight.tick(self.start + self.ticks / 100, self.position)
        self.states.append(self.flight.flight_state)
        self.ticks += 1
        return output

    def thrusts(self):
        """Return (time, thrust)."""
        return [(time, o.thrust) for time, o in self.said if o.thrust is not None]

    def references(self):
        """Return (time, reference)."""
        return [(time, o.reference) for time, o in self.said if o.reference is not None]

    def toggles(self):
        """Return when in_flight was toggled."""
        return [time for time, o in self.said if o.toggle]


def flying(plan=PLAN):
    """Return a flight that has taken off."""
    flight = grounded(plan)
    flight.request(Request.TAKEOFF)
    Clock(flight, start=0.0).run(6.01)
    assert flight.flight_state is FLYING
    return flight


def in_state(state):
    """Return a flight in a state that it has reached by itself."""
    flight = grounded()
    if state is ON_GROUND:
        return flight
    flight.request(Request.TAKEOFF)
    flight.tick(0.0)
    if state is TAKING_OFF:
        return flight
    flight.tick(6.01)
    if state is FLYING:
        return flight
    flight.request(Request.LAND)
    flight.tick(6.02, (0.0, 0.0, 1.0 if state is DESCENDING else 0.0))
    assert flight.flight_state is state
    return flight
