"""State diagrams are drawn from tables of transitions."""

import enum
from pathlib import Path

import pytest

from crazyflie_dev.state_diagrams import diagram, with_diagrams
from crazyflie_takeoff.transition_table import Transition


class Lamp(enum.Enum):
    OFF = "off"
    ON = "on"


class Event(enum.Enum):
    SWITCH_ON = "switch on"
    TICK = "tick"


def _has_current(_):
    return True


def count(_):
    pass


TABLE = (
    Transition(Lamp.OFF, Event.SWITCH_ON, _has_current, Lamp.ON, count),
    Transition(Lamp.ON, Event.TICK, None, Lamp.ON, count),
    Transition(Lamp.ON, Event.TICK, None, Lamp.OFF),
)

DIAGRAM = """```mermaid
stateDiagram-v2
    [*] --> OFF
    OFF --> ON: switch on [has current] / count
    ON --> OFF: tick
```
"""


def test_an_arrow_for_each_row_that_leaves_its_state():
    assert diagram(TABLE) == DIAGRAM


def test_a_diagram_takes_the_place_of_the_old_one():
    comment = f"<!-- states: {__name__}:TABLE -->\n"
    page = f"# A node\n\n{comment}\nText.\n\n```mermaid\nother\n```\n"
    made = with_diagrams(page)
    assert made == f"# A node\n\n{comment}\n{DIAGRAM}\nText.\n\n```mermaid\nother\n```\n"
    assert with_diagrams(made) == made


@pytest.mark.parametrize("name", ["ros/src/crazyflie_takeoff/README.md", "docs/safety.md"])
def test_diagrams_of_the_pages_are_those_of_the_code(name):
    page = (Path(__file__).resolve().parents[4] / name).read_text()
    assert "<!-- states: " in page
    assert with_diagrams(page) == page
