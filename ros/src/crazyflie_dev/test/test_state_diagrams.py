"""State diagrams are drawn from tables of transitions."""

import enum
from pathlib import Path

import pytest

from crazyflie_dev.state_diagrams import diagram, with_diagrams
from crazyflie_takeoff.guards import Guard


class Lamp(enum.IntEnum):
    OFF = 1
    ON = 2
    BROKEN = 3


TABLE = (
    Guard("switch", (Lamp.OFF,), lambda facts, memory: True, Lamp.ON),
    Guard("hot", (Lamp.OFF, Lamp.ON), lambda facts, memory: "40 C", Lamp.BROKEN, "it is {}", 2.5),
    Guard("dropped", (Lamp.ON,), lambda facts, memory: False, Lamp.BROKEN, "it fell"),
    Guard("blown", (Lamp.BROKEN,), lambda facts, memory: True, Lamp.BROKEN, "off", "limits/time"),
)

DIAGRAM = """```mermaid
stateDiagram-v2
    [*] --> OFF
    OFF --> ON: switch
    OFF --> BROKEN: hot
    ON --> BROKEN: hot, dropped
```
"""

GUARDS = """| guard | in | after | next | says | test |
|---|---|---|---|---|---|
| switch | `OFF` |  | `ON` |  | [switch](test_lamp.py) |
| hot | `OFF`, `ON` | 2.5 s | `BROKEN` | it is ... | [hot](test_lamp.py) |
| dropped | `ON` |  | `BROKEN` | it fell | [dropped](test_lamp.py) |
| blown | `BROKEN` | `limits/time` | `BROKEN` | off | [blown](test_lamp.py) |
"""


def test_an_arrow_for_each_row_that_leaves_its_state():
    assert diagram(TABLE) == DIAGRAM


def test_a_table_has_a_row_for_each_guard():
    comment = f"<!-- guards: {__name__}:TABLE test_lamp.py -->\n"
    made = with_diagrams(f"{comment}\n| an old row |\n\n| another table |\n")
    assert made == f"{comment}\n{GUARDS}\n| another table |\n"
    assert with_diagrams(made) == made


def test_a_diagram_takes_the_place_of_the_old_one():
    comment = f"<!-- states: {__name__}:TABLE -->\n"
    page = f"# A node\n\n{comment}\nText.\n\n```mermaid\nother\n```\n"
    made = with_diagrams(page)
    assert made == f"# A node\n\n{comment}\n{DIAGRAM}\nText.\n\n```mermaid\nother\n```\n"
    assert with_diagrams(made) == made


@pytest.mark.parametrize(
    "name", ["ros/src/crazyflie_takeoff/README.md", "docs/safety.md", "docs/faults.md"]
)
def test_diagrams_of_the_pages_are_those_of_the_code(name):
    page = (Path(__file__).resolve().parents[4] / name).read_text()
    assert "<!-- states: " in page or "<!-- guards: " in page
    assert with_diagrams(page) == page
