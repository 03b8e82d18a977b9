"""Tables are searched row by row; the first row whose guard holds is used."""

import enum

from crazyflie_takeoff.transition_table import Transition, find, step, words


class Lamp(enum.Enum):
    OFF = "off"
    ON = "on"


class Event(enum.Enum):
    SWITCH = "switch"
    BREAK = "break"


def has_current(context):
    return context["current"]


def count_switches(context):
    context["switches"] += 1


TABLE = (
    Transition(Lamp.OFF, Event.SWITCH, has_current, Lamp.ON, count_switches),
    Transition(Lamp.ON, Event.SWITCH, None, Lamp.OFF, count_switches),
    Transition(Lamp.ON, Event.SWITCH, has_current, Lamp.ON),
)


def test_a_row_is_taken_when_its_guard_holds():
    context = {"current": False, "switches": 0}
    assert step(TABLE, Lamp.OFF, Event.SWITCH, context) is Lamp.OFF
    context["current"] = True
    assert step(TABLE, Lamp.OFF, Event.SWITCH, context) is Lamp.ON
    assert context["switches"] == 1


def test_the_first_row_counts_and_other_events_are_ignored():
    context = {"current": True, "switches": 0}
    assert find(TABLE, Lamp.ON, Event.SWITCH, context) is TABLE[1]
    assert step(TABLE, Lamp.ON, Event.BREAK, context) is Lamp.ON
    assert find(TABLE, Lamp.ON, Event.BREAK, context) is None
    assert context["switches"] == 0


def test_names_are_the_words():
    assert words(has_current) == "has current"
    assert words(None) == ""
