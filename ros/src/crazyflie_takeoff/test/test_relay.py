"""What is passed on of one control: late ones, those of a landing, and what they teach."""

import pytest
from filter_flight import DESCENDING, FLYING, LANDING, LIMITS, ON_GROUND, TAKING_OFF, G, level

from crazyflie_model.limits import MIN_THRUST
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.relay import Relay
from crazyflie_takeoff.safe_control import Setpoint

TILTED = Setpoint(0.2, -0.1, 1.0, G + 0.5)
HALF = pytest.approx((0.1, -0.05, 0.5, G + 0.25))


def relay(state=FLYING):
    """Return a relay that has listened, whose controls fade from 0.125 s to 0.25 s."""
    relay = Relay(LIMITS, 0.25)
    relay.choice.stop_listening(0.0)
    relay.choice.state = state
    return relay


def command(relay, setpoint, time=1.0, age=0.0, is_on_ground=True):
    assert relay.choose(time, "control", setpoint) == "control"
    return relay.commanded(time, "control", age, is_on_ground)


def at(z):
    return Motion((0.0, 0.0, z), (0.0, 0.0, 0.0))


def test_a_control_that_is_late_fades_to_level_hover():
    flying = relay()
    assert flying.passed == level(G)
    assert flying.late(9.0, 9.0, True) is None
    assert command(flying, TILTED) == "control"
    assert flying.passed == TILTED
    fading = [flying.late(9.0, silence, True) for silence in (0.125, 0.1875, 0.25, 9.0)]
    assert fading == [None, HALF, level(G), level(G)]
    assert flying.late(9.0, 0.13, True) is not None


def test_a_control_that_is_made_of_old_data_fades_too():
    flying = relay()
    passed = [command(flying, TILTED, age=age) for age in (0.125, 0.1875, 0.25)]
    assert passed == ["control", HALF, level(G)]
    assert command(flying, TILTED, age=0.13) != "control"


def test_a_takeoff_control_that_is_late_fades_for_half_a_second():
    lifting = relay(TAKING_OFF)
    assert lifting.takeoff(1.0, "lift", TILTED) == "lift"
    times = (1.125, 1.1875, 1.25, 1.5, 1.5625)
    fading = [None, HALF, level(G), level(G), None]
    assert [lifting.late(time, 9.0, False) for time in times] == fading
    assert [lifting.repeated("lift", time) for time in times[:3]] == ["lift", *fading[1:3]]
    assert "lift" != lifting.repeated("lift", 1.13) == lifting.late(1.13, 9.0, False)
    # Less than hover is of a ramp, which goes on.
    lifting.takeoff(2.0, "ramp", level(G))
    assert lifting.late(2.25, 9.0, False) is None
    assert lifting.repeated("ramp", 2.25) == "ramp"


@pytest.mark.parametrize("state", [FLYING, ON_GROUND])
def test_a_takeoff_control_is_not_faded_in_flight_nor_on_the_ground(state):
    other = relay(state)
    other.takeoff(1.0, "control", TILTED if state is FLYING else level(0.0))
    assert other.late(1.25, 9.0, False) is None


@pytest.mark.parametrize(
    ("step", "is_on_ground", "learned"),
    [(0.1875, False, 0.1875 / 2.1875), (0.25, False, 0.0), (0.125, True, 0.0), (-0.5, False, 0.0)],
)
def test_hover_is_learned_from_controls_that_follow_each_other_in_flight(
    step, is_on_ground, learned
):
    flying = relay()
    for time in (1.0, 1.0 + step):
        command(flying, level(G + 1.0), time, is_on_ground=is_on_ground)
    assert flying.hover - G == pytest.approx(learned)


def test_what_a_vehicle_accelerates_by_is_not_learned():
    flying = relay()
    for time, z_dot in ((1.0, 0.0), (1.125, 0.0), (1.25, 0.125)):
        flying.measure(Motion((0.0, 0.0, 1.0), (9.0, 9.0, z_dot)))
        command(flying, level(G + 1.0), time, is_on_ground=False)
    thrust = 1.0 - (2.0 / 2.125) ** 2
    assert flying.hover - G == pytest.approx(thrust - 0.125 * (2.0 / 2.125) / 2.0)


def test_without_a_state_a_vehicle_neither_climbs_nor_falls():
    flying = relay()
    flying.watch.gaps.run(1.0)
    flying.watch.gaps.run(1.25)
    # 0.5 m/s within the gap.
    assert command(flying, level(G + 9.0)).thrust - G == pytest.approx(2.0)


@pytest.mark.parametrize(("state", "least"), [(FLYING, MIN_THRUST), (TAKING_OFF, 0.0)])
def test_the_least_thrust_of_a_control(state, least):
    other = relay(state)
    assert command(other, level(-3.0)) == level(least)
    assert other.takeoff(2.0, "ramp", level(-3.0)) == level(0.0)


@pytest.mark.parametrize(
    ("state", "z", "age", "height"),
    [
        (DESCENDING, 1.0, 0.0, 0.75),
        (DESCENDING, 0.25, 0.0, None),
        (DESCENDING, 1.0, 0.3, None),
        (FLYING, 1.0, 0.0, None),
        (LANDING, 1.0, 0.0, None),
    ],
)
def test_the_height_of_a_vehicle_that_its_controller_brings_down(state, z, age, height):
    landing = relay(None)
    landing.takeoff(0.0, "zero", level(0.0))
    landing.measure(at(0.25))
    landing.choice.state = state
    landing.measure(at(z), age)
    assert landing.landing_height == height
