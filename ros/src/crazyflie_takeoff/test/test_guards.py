"""Each row of the supervisor's table: what it waits for, how long, and what comes then."""

import pytest
from filter_flight import (
    DESCENDING,
    FLYING,
    LANDING,
    ON_GROUND,
    TAKING_OFF,
    TIMEOUTS,
    G,
    Supervised,
    at,
    level,
)

from crazyflie_model.limits import MAX_THRUST
from crazyflie_model.supervisor import SupervisorState
from crazyflie_msgs.msg import FilterStatus
from crazyflie_takeoff import guards, supervisor
from crazyflie_takeoff.fallback import MOTORS_OFF, RETURN_TIME
from crazyflie_takeoff.guards import AIRBORNE, FLOWN, GUARDS, HELD
from crazyflie_takeoff.phases import FilterState, Phase
from crazyflie_takeoff.vehicle_facts import VehicleFacts
from crazyflie_utils.refusal import RefusalError

NO_CONTROL = f"no control came for {TIMEOUTS.hold + TIMEOUTS.place:.1f} s"


class Case(Supervised):
    """A supervisor which sees a vehicle that stays where it is, and hears controls or none."""

    def __init__(self, sees=False):
        super().__init__(sees=sees, vehicle=VehicleFacts("/connected", str))
        self.now = 0.0
        self.seen = None
        self.control = None
        self.vehicle_state = None
        self.tick(0.0)

    @property
    def phase(self):
        return self.memory.phase

    def run(self, seconds, step=0.01):
        for _ in range(round(seconds / step)):
            self.now += step
            if self.vehicle_state is not None:
                self.facts.vehicle.set_status(self.now, self.vehicle_state, True, False)
            if self.seen is not None:
                self.measure(self.seen._replace(), time=self.now)
            if self.control is not None:
                self.commanded(self.now, "fly", self.control)
            self.tick(self.now)
        return self

    def lasts(self, phase, step=0.01):
        """Return the time until a phase begins, s."""
        begin = self.now
        while self.phase is not phase:
            assert self.now - begin < 10.0
            self.run(step, step)
        return pytest.approx(self.now - begin, abs=2.01 * step)

    def serve(self, thrust, name="server"):
        return self.takeoff(self.now, "served", level(thrust), name)


def case_in(phase):
    """Return a case in a phase, in which it has come by itself."""
    case = Case()
    if phase is not Phase.LISTENING:
        case.seen, case.flight_state = at(0.0), ON_GROUND
        case.run(0.1).serve(0.0)
    if phase not in (Phase.LISTENING, Phase.ON_GROUND):
        case.flight_state = TAKING_OFF
        case.serve(G + 0.2)
        case.seen, case.control, case.flight_state = at(1.0), level(G), FLYING
        case.run(1.0)
    if phase in (Phase.HOLDING, Phase.RETURNING, Phase.SINKING, Phase.DOWN):
        case.control = None
        case.lasts(Phase.HOLDING)
    if phase is Phase.RETURNING:
        case.control = level(G)
        case.run(0.01)
    if phase in (Phase.SINKING, Phase.DOWN):
        case.lasts(Phase.SINKING)
        case.seen = at(1.0, -0.3)
    if phase is Phase.DOWN:
        case.seen = at(0.0)
        case.lasts(Phase.DOWN)
    if phase is Phase.EMERGENCY:
        case.stop("it was called")
    assert case.phase is phase
    return case


# The rows, in their order; each of these tests is also run without a part of its row.


def test_emergency():
    for phase in set(Phase) - {Phase.EMERGENCY}:
        case = case_in(phase)
        assert case.run(0.05).phase is phase
        case.stop("it was called")
        assert (case.phase, case.reason) == (Phase.EMERGENCY, "it was called")
        assert case.tick(case.now) == MOTORS_OFF


def test_on_the_ground():
    case = case_in(Phase.PASSING)
    case.flight_state = LANDING
    assert case.run(0.01).phase is Phase.PASSING
    case.serve(0.0)
    assert (case.phase, case.reason) == (Phase.ON_GROUND, "")


def test_off_the_ground():
    case = case_in(Phase.ON_GROUND)
    case.serve(0.0)
    assert case.run(1.0).phase is Phase.ON_GROUND
    case.serve(0.1)
    assert case.run(0.01).phase is Phase.PASSING


def test_tipped_over():
    for phase in AIRBORNE:
        case = case_in(phase)
        case.facts.is_tilted = True
        assert case.lasts(Phase.EMERGENCY) == 0.0
        assert case.reason == "the vehicle has tilted over"


def test_out_of_bounds():
    for phase in AIRBORNE:
        case = case_in(phase)
        case.seen = at(1.0, -0.3, x=2.4)
        case.run(0.15)
        case.seen = at(1.0, -0.3, x=2.6)
        assert case.lasts(Phase.EMERGENCY) == guards.CRASH_DURATION
        assert case.reason == "0.60 m outside the geofence"


def test_vehicle_cannot_fly():
    for phase in AIRBORNE:
        case = case_in(phase)
        case.vehicle_state = SupervisorState.ARMED | SupervisorState.CRASHED
        assert case.lasts(Phase.DOWN) == guards.MAX_FAULT_TIME
        assert case.reason.startswith("the vehicle cannot fly")


def test_two_publishers():
    for phase in FLOWN:
        case = case_in(phase)
        for name in "aba":
            case.commanded(case.now, "fly", level(G), name)
            assert case.phase is phase
        case.commanded(case.now, "fly", level(G), "b")
        assert case.phase is Phase.SINKING
        expected = "two nodes publish commanded controls, a and b; expected one; the filter lands"
        assert case.reason == expected
    # A second server is one at once, and a vehicle that is held sinks from where it is.
    case = case_in(Phase.HOLDING)
    fallback = case.memory.fallback
    case.serve(0.0, "another server")
    assert case.phase is Phase.SINKING
    assert case.memory.fallback is fallback


def test_climbs():
    for phase in HELD:
        case = case_in(Phase.RETURNING if phase is Phase.RETURNING else Phase.PASSING)
        case.seen, case.control = at(1.0, 2.9), level(MAX_THRUST)
        begin = case.now
        if phase is Phase.HOLDING:
            case.run(0.5).control = None
        case.lasts(Phase.SINKING)
        assert case.now - begin == pytest.approx(guards.CLIMB_TIMEOUT, abs=0.021)
        assert case.reason == "the controls climb faster than 3 m/s; the filter lands"


def test_busy_computer():
    for phase in HELD:
        case = case_in(Phase.PASSING if phase is Phase.PASSING else Phase.HOLDING)
        case.run(1.5, step=0.3)
        if phase is Phase.RETURNING:
            case.control = level(G)
        # The share of the time that is lost averages over 3 s: 3 ln 2.
        assert case.lasts(Phase.SINKING, step=0.3) == 0.6
        assert case.reason == "this computer is too busy for a flight; the filter lands"


def test_does_not_come_down():
    for phase in FLOWN:
        case = case_in(phase)
        case.flight_state = DESCENDING
        assert case.lasts(Phase.SINKING) == guards.DESCENT_TIMEOUT
        assert (
            case.reason == "the vehicle has not come down for 1.5 s of a landing; the filter lands"
        )


def test_began_on_the_ground():
    for z, phase in ((0.099, Phase.DOWN), (0.101, Phase.PASSING)):
        case = Case(sees=True)
        case.flight_state, case.seen, case.control = FLYING, at(z), level(G)
        assert case.run(0.01).phase is phase
        case = Case(sees=True)
        case.flight_state = FLYING
        case.lasts(Phase.HOLDING)
        case.seen = at(z)
        assert case.run(0.01).phase is (phase if phase is Phase.DOWN else Phase.HOLDING)
        if phase is Phase.DOWN:
            assert case.reason == "the vehicle was on the ground when the filter began"
    # A vehicle that has been seen in the air is not on the ground.
    case = case_in(Phase.HOLDING)
    case.seen = at(0.0)
    assert case.run(0.1).phase is Phase.HOLDING


def test_began_in_flight():
    case = Case(sees=True)
    case.flight_state = FLYING
    case.commanded(0.05, "fly", level(G))
    assert case.phase is Phase.LISTENING
    case.measure(at(1.0))
    assert case.commanded(0.06, "fly", level(G)) == "fly"
    assert case.phase is Phase.PASSING


def test_has_listened():
    case = Case()
    case.toggle()
    assert case.run(0.05).phase is Phase.LISTENING
    case.stop_listening(case.now)
    assert case.phase is Phase.PASSING


def test_server_is_there():
    case = Case()
    assert case.run(1.0).phase is Phase.LISTENING
    assert case.serve(0.0) == "served"
    assert case.phase is Phase.ON_GROUND


def test_no_control():
    for phase in (Phase.LISTENING, *FLOWN):
        case = case_in(phase)
        case.flight_state, case.control = FLYING, None
        assert case.lasts(Phase.HOLDING) == TIMEOUTS.hold
        assert case.reason == "no control comes, the filter keeps the vehicle in place"
        assert case.memory.takeovers == (2 if phase is Phase.RETURNING else 1)


def test_control_is_back():
    case = case_in(Phase.HOLDING)
    assert case.run(1.0).phase is Phase.HOLDING
    own = case.tick(case.now)
    assert case.commanded(case.now, "fly", level(G + 2.0)) == own
    assert (case.phase, case.reason) == (Phase.RETURNING, "")


def test_server_flies():
    for phase in (Phase.HOLDING, Phase.RETURNING):
        case = case_in(phase)
        assert case.run(0.05).phase is phase
        assert case.serve(5.0) == "served"
        assert case.phase is Phase.PASSING


def test_control_stays_away():
    for state, seen, limit in (
        (FLYING, at(1.0), TIMEOUTS.place),
        (FLYING, None, TIMEOUTS.recovery),
        (LANDING, at(1.0), TIMEOUTS.recovery),
    ):
        case = case_in(Phase.HOLDING)
        case.flight_state, case.seen = state, seen
        if seen is None:
            # Without a server the controller may have had no reference.
            case.facts.server_missed = case.facts.ran
        assert case.lasts(Phase.SINKING) == limit
        assert case.reason == f"no control came for {TIMEOUTS.hold + limit:.1f} s"
        assert case.facts.lacks_controller == (seen is not None)


def test_return_is_over():
    case = case_in(Phase.RETURNING)
    assert case.lasts(Phase.PASSING) == RETURN_TIME
    assert case.commanded(case.now, "fly", level(G)) == "fly"


def test_touchdown():
    case = case_in(Phase.SINKING)
    assert case.run(2.0).phase is Phase.SINKING
    case.seen = at(0.0)
    assert case.lasts(Phase.DOWN).expected < 1.0
    assert case.reason == f"brought down by the filter because {NO_CONTROL}"


def test_descent_is_too_long():
    case = case_in(Phase.SINKING)
    limit = case.memory.descent_limit
    # 1 m at 0.4 m/s.
    assert limit == pytest.approx(TIMEOUTS.descent + 2.5)
    case.seen = None
    assert case.lasts(Phase.DOWN) == limit
    assert case.reason == f"motors stopped after 7.5 s of descent: {NO_CONTROL}"
    # A vehicle that is seen to sink is still in the air.
    assert case_in(Phase.SINKING).run(limit + 2.0).phase is Phase.SINKING


def test_takeoff():
    case = case_in(Phase.DOWN)
    case.flight_state = ON_GROUND
    assert case.serve(G) is None
    assert case.run(1.0).phase is Phase.DOWN
    assert case.serve(G + 0.2) == "served"
    assert (case.phase, case.reason) == (Phase.PASSING, "")


def test_a_takeoff_control_that_is_refused_ends_no_rest():
    case = case_in(Phase.DOWN)
    case.flight_state = LANDING
    for name, thrust in (("a", 7.0), ("b", 20.0)):
        case.run(0.01)
        case.takeoff(case.now, "control", level(thrust), name)
    assert supervisor.takeoff_refusal(case.memory, case.facts)
    # Nor does it count when the contention is forgotten.
    for _ in range(600):
        case.run(0.01)
        assert case.commanded(case.now, "climb", level(16.0)) is None
        assert case.phase is Phase.DOWN
    assert supervisor.takeoff_refusal(case.memory, case.facts) == ""


def test_a_takeoff_after_a_rest_is_no_loss_of_control():
    """The controller is silent until it has a reference."""
    case = case_in(Phase.DOWN).run(1.0)
    case.flight_state = TAKING_OFF
    assert case.serve(G + 0.2) == "served"
    assert case.run(0.01).phase is Phase.PASSING
    assert case.memory.takeovers == case_in(Phase.DOWN).memory.takeovers


def test_zero_thrust_of_a_second_server_drops_no_vehicle():
    case = case_in(Phase.PASSING)
    case.flight_state = TAKING_OFF
    case.takeoff(case.now, "lift", level(G + 0.2), "a")
    case.run(0.01).flight_state = ON_GROUND
    assert case.takeoff(case.now, "zero", level(0.0), "b") is None
    assert case.phase is Phase.SINKING


def test_the_ground_is_measured_after_a_flight_that_was_ended():
    case = case_in(Phase.DOWN)
    case.flight_state = ON_GROUND
    case.run(0.1).serve(0.0)
    case.seen = at(-0.4)
    assert case.run(0.1).facts.ground.z == -0.4


def test_reset():
    case = case_in(Phase.EMERGENCY).run(guards.RESET_DELAY - 0.1)
    with pytest.raises(RefusalError, match="less than 2 s ago"):
        case.reset()
    assert case.phase is Phase.EMERGENCY
    case.run(0.11).reset()
    assert (case.phase, case.reason) == (Phase.DOWN, "reset after an emergency")


# The table as a whole.


@pytest.mark.parametrize(
    ("row", "phase"),
    [(row, phase) for row in GUARDS for phase in row.phases],
    ids=lambda value: value.name,
)
def test_each_phase_of_each_row_is_needed(row, phase, monkeypatch):
    rows = supervisor._BY_PHASE[phase]
    monkeypatch.setitem(supervisor._BY_PHASE, phase, [each for each in rows if each is not row])
    with pytest.raises(AssertionError):
        globals()[f"test_{row.name.replace(' ', '_')}"]()


def test_no_change_of_phase_restarts_a_guard():
    """A controller at 8 Hz: the vehicle is held, and returned to it, again and again."""
    case, phases = case_in(Phase.PASSING), []
    case.control = None
    for k in range(120):
        if k % 12 == 0:
            case.commanded(case.now, "fly", level(G))
        if k == 60:
            case.seen = at(1.0, x=9.0)
        phases.append(case.run(0.01).phase)
    assert set(phases[20:60]) == {Phase.HOLDING, Phase.RETURNING}
    assert phases.index(Phase.EMERGENCY) == pytest.approx(60 + 100 * guards.CRASH_DURATION, abs=2)


def ends(phase):
    return {row.next for row in GUARDS if phase in row.phases}


def test_each_phase_has_an_exit_and_an_entry():
    assert all(ends(phase) - {phase} for phase in Phase)
    assert {row.next for row in GUARDS} == set(Phase) - {Phase.LISTENING}


def test_no_control_ends_a_descent_or_an_emergency():
    assert ends(Phase.SINKING) == {Phase.DOWN, Phase.EMERGENCY}
    assert ends(Phase.DOWN) == {Phase.ON_GROUND, Phase.EMERGENCY}
    assert ends(Phase.EMERGENCY) == {Phase.DOWN}
    assert not any(phase.follows for phase in (Phase.SINKING, Phase.DOWN, Phase.EMERGENCY))


def test_states_are_those_of_the_message():
    assert {each.name: each.value for each in FilterState} == {
        name: getattr(FilterStatus, name) for name in FilterState.__members__
    }


# Details of single rows.


@pytest.mark.parametrize(
    ("state", "seen", "sinks"),
    [
        (DESCENDING, at(0.051), True),
        (DESCENDING, at(0.049), False),
        (DESCENDING, None, False),
        (FLYING, at(1.0), False),
        (LANDING, at(1.0), False),
    ],
)
def test_only_a_landing_that_is_seen_above_the_ground_must_come_down(state, seen, sinks):
    case = case_in(Phase.PASSING)
    case.flight_state, case.seen = state, seen
    assert (case.run(2.0).phase is Phase.SINKING) == sinks


def test_a_slow_landing_comes_down_and_climbs_as_it_may():
    case = case_in(Phase.PASSING)
    case.flight_state, case.control = DESCENDING, level(MAX_THRUST)
    for k in range(400):
        case.seen = at(1.0 - 0.0006 * k, 2.9)
        assert case.run(0.01).phase is Phase.PASSING
