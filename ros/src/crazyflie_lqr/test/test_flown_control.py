"""The integrator rests while other controls than those of the controller are flown."""

import pytest
from lift_controller import answer, lifting, publish_flight_state, refer

from crazyflie_msgs.msg import Control, ControlStamped

LEVEL = (0.0, 0.0, 0.0, 9.6)
FINAL = "/control/final"


def hovering(replace=lambda u: u, **changes):
    """Return a process whose controller has flown for a while."""
    process = lifting(**changes)
    publish_flight_state(process, "flying")
    refer(process, z=1.0)
    for _ in range(20):
        thrust(process, replace, 1.0, changes.get("topics/final_control", FINAL))
    return process


def thrust(process, replace=lambda u: u, z=0.8, topic=FINAL):
    """Return the thrust for a height; what is flown is ``replace(u)`` of the control."""
    process.advance(0.1)
    [u] = answer(process, z=z)
    if (flown := replace(u)) is not None:
        process.publish(topic, ControlStamped(control=Control(*flown)))
    return u[3]


def growth(process, replace, count=20):
    """Return by how much the thrust grows in 2 s, during which 0.2 is what the integral adds."""
    course = [thrust(process, replace) for _ in range(count + 1)]
    return course[-1] - course[0]


def test_it_integrates_what_is_flown():
    assert growth(hovering(), lambda u: u) == pytest.approx(0.2)


@pytest.mark.parametrize(
    "replace",
    [lambda u: LEVEL, lambda u: None, lambda u: u + [0.0, 0.0, 0.0, 1.0]],
    ids=["hold", "silence", "fence"],
)
def test_it_rests_while_something_else_is_flown_and_goes_on(replace):
    process = hovering()
    before = thrust(process)
    growth(process, replace, count=60)
    assert thrust(process) - before < 0.06
    assert growth(process, lambda u: u) == pytest.approx(0.2, abs=0.02)


def test_it_integrates_along_an_axis_while_a_wall_holds_the_vehicle_along_another():
    process = hovering()
    assert growth(process, lambda u: u + [0.1, -0.1, 0.0, 0.0]) == pytest.approx(0.2)


@pytest.mark.parametrize("replace", [lambda u: LEVEL, lambda u: None], ids=["others", "nobody"])
def test_it_integrates_where_its_controls_were_never_seen(replace):
    """As behind a filter that publishes on another topic."""
    assert growth(hovering(replace), replace) == pytest.approx(0.2)


def test_controls_that_are_changed_a_little_or_come_late_are_its_own():
    sent = []

    def late(u):
        sent.append(u + [0.01, -0.01, 3.0, 0.1])
        return sent[-3:][0]

    assert growth(hovering(), late) == pytest.approx(0.2)


def test_the_topic_may_be_named():
    topic = "/cf1/out"
    process = hovering(**{"topics/final_control": topic})
    before = thrust(process, topic=topic)
    course = [thrust(process, lambda u: LEVEL, topic=topic) for _ in range(20)]
    assert max(course) - before < 0.05


def test_a_climb_learns_from_the_thrust_that_is_flown():
    process = lifting()
    publish_flight_state(process, "taking_off")
    refer(process, z=1.0)
    thrust(process, z=0.0)
    course = [thrust(process, lambda u: (0.0, 0.0, 0.0, 9.0), z=0.0) for _ in range(30)]
    # It stays where it is with 9 m/s^2, so it hovers with that. The rest is the climb's reference.
    assert course[-1] == pytest.approx(9.0 + 1.5 * 0.15 + 1.0 * 0.4, abs=0.01)
