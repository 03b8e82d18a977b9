"""The state machine of takeoff and landing, with a clock moved by hand."""

import pytest

from crazyflie_takeoff.flight import FlightStateMachine, Plan
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_utils.refusal import RefusalError

G = 9.81
PLAN = Plan(hover=(0.1, 0.2, 1.0), open_loop=1.0, settle=5.0, descent_speed=0.3)
BARE = Plan(hover=(0.1, 0.2, 1.0), open_loop=1.0, settle=5.0, descent_speed=0.0)

ON_GROUND, TAKING_OFF, FLYING, DESCENDING, LANDING = FlightState


class Clock:
    """Ticks a flight every 10 ms and keeps what it puts out, by time from now."""

    def __init__(self, flight, position=None, start=1000.0):
        self.flight = flight
        self.position = position
        self.ticks = 0
        self.start = start
        self.said = []

    def run(self, duration):
        """Tick for a time, s; return self."""
        for _ in range(round(duration / 0.01)):
            self.said.append((self.ticks / 100, self.tick()))
        return self

    def run_until(self, state, limit=20.0):
        """Tick until a state is reached; return the time."""
        while self.flight.state is not state:
            self.run(0.01)
            assert self.ticks < limit * 100, f"{state} was not reached"
        return self.said[-1][0]

    def tick(self):
        """Tick once, 10 ms after the last time."""
        output = self.flight.tick(self.start + self.ticks / 100, self.position)
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
    flight = FlightStateMachine(plan)
    flight.takeoff()
    Clock(flight, start=0.0).run(6.01)
    assert flight.state is FLYING
    return flight


def test_zero_thrust_is_repeated_at_10_hz_on_the_ground():
    clock = Clock(FlightStateMachine(PLAN)).run(1.0)
    assert clock.thrusts() == [(pytest.approx(0.1 * k), 0.0) for k in range(10)]
    assert clock.references() == clock.toggles() == []


def test_takeoff_step_by_step():
    flight = FlightStateMachine(PLAN)
    clock = Clock(flight).run(0.37)
    clock.said.clear()
    flight.takeoff()
    clock.run(10.0)
    assert clock.thrusts() == [(pytest.approx(0.37 + k / 100), G + 0.2) for k in range(100)]
    assert clock.references() == [(pytest.approx(1.37), (0.1, 0.2, 1.0, 0.0, 0.0, 0.0))]
    assert clock.toggles() == [pytest.approx(6.37)]
    assert [output.state for _, output in clock.said] == [TAKING_OFF] * 600 + [FLYING] * 400


@pytest.mark.parametrize(("open_loop", "settle"), [(0.0, 1.0), (0.5, 0.0), (0.0, 0.0)])
def test_durations_may_be_zero(open_loop, settle):
    flight = FlightStateMachine(Plan((0.0, 0.0, 1.0), open_loop, settle, 0.3))
    flight.takeoff()
    clock = Clock(flight).run(3.0)
    assert len(clock.thrusts()) == round(open_loop * 100)
    assert [time for time, _ in clock.references()] == [open_loop]
    assert clock.toggles() == [open_loop + settle]


def test_a_tick_that_is_very_late_skips_nothing():
    flight = FlightStateMachine(PLAN)
    flight.takeoff()
    flight.tick(0.0)
    output = flight.tick(100.0)
    assert output.reference == (0.1, 0.2, 1.0, 0.0, 0.0, 0.0)
    assert output.toggle
    assert output.state is FLYING


def test_bare_landing_step_by_step():
    flight = flying(BARE)
    flight.land()
    clock = Clock(flight).run(2.0)
    ramp = [(pytest.approx(k / 100), pytest.approx(G - 5.0 * k / 100)) for k in range(100)]
    zeros = [(pytest.approx(1.0 + k / 10), 0.0) for k in range(10)]
    assert clock.thrusts() == ramp + zeros
    assert clock.references() == []
    assert clock.toggles() == [0.0]
    assert [output.state for _, output in clock.said] == [LANDING] * 100 + [ON_GROUND] * 100


def test_a_landing_that_does_not_know_the_height_is_bare():
    flight = flying(PLAN)
    flight.land()
    clock = Clock(flight, position=None).run(1.01)
    assert clock.thrusts()[0] == (0.0, G)
    assert clock.references() == []
    assert flight.state is ON_GROUND


def test_landing_descends_first():
    flight = flying()
    flight.land()
    clock = Clock(flight, position=(0.5, -0.5, 1.0))
    clock.run(1.0)
    assert clock.thrusts() == []
    assert clock.toggles() == []
    assert flight.state is DESCENDING
    expected = [
        (pytest.approx(k / 100), pytest.approx((0.5, -0.5, 1.0 - 0.003 * k, 0.0, 0.0, -0.3)))
        for k in range(100)
    ]
    assert clock.references() == expected
    clock.position = (0.5, -0.5, 0.051)
    clock.run(0.5)
    assert clock.thrusts() == []
    clock.position = (0.5, -0.5, 0.049)
    clock.run(2.0)
    assert clock.thrusts()[0] == (1.5, G)
    assert clock.toggles() == [1.5]
    assert flight.state is ON_GROUND
    assert clock.thrusts()[100] == (2.5, 0.0)


def test_the_ground_is_where_the_vehicle_took_off():
    flight = FlightStateMachine(PLAN)
    Clock(flight, position=(0.0, 0.0, 0.7), start=0.0).run(0.1)
    flight.takeoff()
    Clock(flight, position=(0.0, 0.0, 1.5), start=1.0).run(6.01)
    flight.land()
    clock = Clock(flight, position=(0.0, 0.0, 0.76)).run(0.1)
    assert flight.state is DESCENDING
    clock.position = (0.0, 0.0, 0.74)
    clock.run(0.01)
    assert flight.state is LANDING


def test_the_reference_presses_only_a_little_below_the_ground():
    flight = flying()
    flight.land()
    clock = Clock(flight, position=(0.0, 0.0, 0.5)).run(4.5)
    heights = [reference[2] for _, reference in clock.references()]
    assert min(heights) == pytest.approx(-0.3)
    assert clock.references()[-1][1] == pytest.approx((0.0, 0.0, -0.3, 0.0, 0.0, 0.0))


def test_a_vehicle_that_does_not_descend_is_landed_all_the_same():
    flight = flying()
    flight.land()
    clock = Clock(flight, position=(0.0, 0.0, 1.0))
    assert clock.run_until(LANDING) == pytest.approx(1.0 / 0.3 + 3.0, abs=0.011)
    # Zero thrust for at most two seconds until it counts as down.
    assert clock.run_until(ON_GROUND) == pytest.approx(1.0 / 0.3 + 6.0, abs=0.03)
    assert clock.thrusts()[-1][1] == 0.0


def test_waits_for_the_touchdown_when_the_height_is_known():
    flight = flying(BARE)
    flight.land()
    clock = Clock(flight, position=(0.0, 0.0, 0.2)).run(1.5)
    assert flight.state is LANDING
    assert [thrust for _, thrust in clock.thrusts()[100:]] == [0.0] * 5
    clock.position = (0.0, 0.0, 0.01)
    assert clock.run_until(ON_GROUND) == pytest.approx(1.5)
    assert clock.said[-1][1].thrust == 0.0


def test_a_descent_without_a_state_goes_on_by_dead_reckoning():
    flight = flying()
    flight.land()
    clock = Clock(flight, position=(0.0, 0.0, 1.0)).run(1.0)
    clock.position = None
    clock.run(1.0)
    expected = [
        (pytest.approx(k / 100), pytest.approx((0.0, 0.0, 1.0 - 0.003 * k, 0.0, 0.0, -0.3)))
        for k in range(200)
    ]
    assert clock.references() == expected
    # The motors are stopped when there has been time enough to sink.
    assert clock.run_until(LANDING) == pytest.approx(1.0 / 0.3 + 3.0, abs=0.011)
    assert clock.thrusts() == [(pytest.approx(1.0 / 0.3 + 3.0, abs=0.011), G)]
    assert clock.run_until(ON_GROUND) == pytest.approx(1.0 / 0.3 + 4.0, abs=0.03)


def test_a_descent_goes_on_from_where_the_vehicle_is_seen_again():
    flight = flying()
    flight.land()
    clock = Clock(flight, position=(0.0, 0.0, 2.0)).run(1.0)
    clock.position = None
    clock.run(2.0)
    clock.position = (0.1, -0.1, 1.9)
    clock.said.clear()
    clock.run(1.0)
    expected = [pytest.approx((0.1, -0.1, 1.9 - 0.003 * k, 0.0, 0.0, -0.3)) for k in range(100)]
    assert [reference for _, reference in clock.references()] == expected
    # It has as long as if it had begun there.
    assert clock.run_until(LANDING) == pytest.approx(3.0 + 1.9 / 0.3 + 3.0, abs=0.011)


def test_a_descent_that_begins_without_a_state_begins_where_the_vehicle_was_seen_last():
    flight = flying()
    Clock(flight, position=(0.5, -0.5, 0.8), start=6.01).run(0.1)
    clock = Clock(flight, start=6.11).run(1.0)
    flight.land()
    clock.said.clear()
    clock.run(0.5)
    assert flight.state is DESCENDING
    expected = [pytest.approx((0.5, -0.5, 0.8 - 0.003 * k, 0.0, 0.0, -0.3)) for k in range(50)]
    assert [reference for _, reference in clock.references()] == expected


@pytest.mark.parametrize("seen", [0.7, None])
def test_a_descent_waits_while_the_filter_holds_the_vehicle(seen):
    flight = flying()
    flight.land()
    clock = Clock(flight, position=(0.0, 0.0, 1.0)).run(1.0)
    clock.position = None if seen is None else (0.0, 0.0, seen)
    height = seen or 1.0
    flight.is_held = True
    clock.run(2.0)
    assert clock.references()[-1][1] == pytest.approx((0, 0, height, 0, 0, -0.3), abs=0.005)
    flight.is_held = False
    clock.run(1.0)
    assert clock.references()[-1][1] == pytest.approx((0, 0, height - 0.3, 0, 0, -0.3), abs=0.01)
    assert clock.run_until(LANDING) == pytest.approx(3.0 + height / 0.3 + 3.0, abs=0.05)


def test_a_descent_that_is_held_for_ever_ends():
    flight = flying()
    flight.land()
    flight.is_held = True
    clock = Clock(flight, position=(0.0, 0.0, 1.0))
    assert clock.run_until(LANDING, 100.0) == pytest.approx(60.0 + 1.0 / 0.3 + 3.0, abs=0.05)


def test_a_descent_keeps_its_speed_when_the_plan_changes():
    flight = flying()
    flight.land()
    flight.plan = BARE
    clock = Clock(flight, position=(0.0, 0.0, 1.0)).run(1.0)
    assert clock.references()[-1][1] == pytest.approx((0.0, 0.0, 0.703, 0.0, 0.0, -0.3))


@pytest.mark.parametrize("sees", [True, False])
def test_a_descent_under_way_is_made_faster(sees):
    flight = flying()
    flight.land()
    clock = Clock(flight, position=(0.0, 0.0, 4.0)).run(1.0)
    clock.position = (0.0, 0.0, 3.7) if sees else None
    clock.run(0.01)
    clock.said.clear()
    flight.hurry(7.0)
    clock.run(1.0)
    (_, first), (_, last) = clock.references()[0], clock.references()[-1]
    assert first == pytest.approx((0.0, 0.0, 3.7, 0.0, 0.0, -3.7 / 7.0), abs=0.01)
    assert last[2] == pytest.approx(3.7 - 0.99 * 3.7 / 7.0, abs=0.01)


def test_a_descent_that_is_fast_enough_is_not_made_slower():
    flight = flying()
    flight.land()
    clock = Clock(flight, position=(0.0, 0.0, 1.0)).run(1.0)
    flight.hurry(7.0)
    clock.run(0.01)
    assert clock.references()[-1][1][5] == -0.3


@pytest.mark.parametrize("state", [ON_GROUND, TAKING_OFF, FLYING, LANDING])
def test_only_a_descent_is_made_faster(state):
    flight, untouched = in_state(state), in_state(state)
    flight.hurry(7.0)
    for k in range(1500):
        moment, position = 6.03 + k / 100, (0.0, 0.0, 1.0)
        assert flight.tick(moment, position) == untouched.tick(moment, position)


def test_flights_can_be_repeated():
    flight = FlightStateMachine(PLAN)
    clock = Clock(flight, position=(0.0, 0.0, 0.0))
    for _ in range(3):
        clock.said.clear()
        flight.takeoff()
        clock.position = (0.0, 0.0, 1.0)
        clock.run(6.01)
        assert len(clock.references()) == 1
        assert len(clock.toggles()) == 1
        clock.position = (0.0, 0.0, 0.0)
        flight.land()
        clock.run(1.01)
        assert len(clock.toggles()) == 2
        assert flight.state is ON_GROUND


def in_state(state):
    """Return a flight in a state that it has reached by itself."""
    flight = FlightStateMachine(PLAN)
    if state is ON_GROUND:
        return flight
    flight.takeoff()
    flight.tick(0.0)
    if state is TAKING_OFF:
        return flight
    flight.tick(6.01)
    if state is FLYING:
        return flight
    flight.land()
    flight.tick(6.02, (0.0, 0.0, 1.0 if state is DESCENDING else 0.0))
    assert flight.state is state
    return flight


@pytest.mark.parametrize("state", FlightState)
@pytest.mark.parametrize("name", ["takeoff", "land"])
def test_refusals_say_why_and_change_nothing(state, name):
    flight, untouched = in_state(state), in_state(state)
    if (state, name) in [(ON_GROUND, "takeoff"), (FLYING, "land"), (TAKING_OFF, "land")]:
        getattr(flight, name)()
        assert flight.state is not state
        return
    words = {
        ON_GROUND: "on the ground",
        TAKING_OFF: "takeoff is under way",
        FLYING: "in flight",
        DESCENDING: "landing is under way",
        LANDING: "landing is under way",
    }
    with pytest.raises(RefusalError, match=words[state]):
        getattr(flight, name)()
    for k in range(1500):
        moment, position = 6.03 + k / 100, (0.0, 0.0, max(0.0, 1.0 - k * 0.003))
        assert flight.tick(moment, position) == untouched.tick(moment, position)


@pytest.mark.parametrize("state", FlightState)
def test_only_a_takeoff_is_aborted(state):
    flight = in_state(state)
    flight.abort()
    assert flight.state is (DESCENDING if state is TAKING_OFF else state)


def test_an_aborted_takeoff_is_a_landing():
    flight = in_state(TAKING_OFF)
    flight.abort()
    clock = Clock(flight, position=(0.0, 0.0, 0.5)).run(1.0)
    # In flight for the descent, and then no more.
    assert clock.toggles() == [0.0]
    clock.position = (0.0, 0.0, 0.0)
    clock.run_until(ON_GROUND)
    assert clock.toggles() == [0.0, 1.0]


def test_a_takeoff_aborted_near_the_ground_was_never_in_flight():
    flight = in_state(TAKING_OFF)
    flight.abort()
    clock = Clock(flight, position=(0.0, 0.0, 0.01)).run(1.01)
    assert flight.state is ON_GROUND
    assert clock.toggles() == []


def test_goes_on_when_the_clock_is_reset():
    flight = FlightStateMachine(PLAN)
    flight.takeoff()
    Clock(flight, start=5000.0).run(0.5)
    clock = Clock(flight, start=0.0).run(7.0)
    assert len(clock.thrusts()) == pytest.approx(51, abs=1)
    assert clock.toggles() == [pytest.approx(5.51, abs=0.011)]
    grounded = FlightStateMachine(PLAN)
    Clock(grounded, start=5000.0).run(0.55)
    assert len(Clock(grounded, start=0.0).run(1.0).thrusts()) == 10


def test_a_recovered_flight_tells_the_truth_by_a_toggle():
    assert not FlightStateMachine(PLAN, FLYING).tick(0.0).toggle
    assert FlightStateMachine(PLAN, FLYING, announced=False).tick(0.0).toggle
    assert FlightStateMachine(PLAN, ON_GROUND, announced=True).tick(0.0).toggle
