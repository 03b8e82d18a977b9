"""State diagrams in the READMEs, drawn from the tables of transitions that run.

In a page, a comment names a table (`crazyflie_takeoff.transition_table`), and the Mermaid diagram
below it is made of its rows; the first row's state is the initial one::

    <!-- states: crazyflie_takeoff.filter_machine:FilterMachine.TABLE -->

``python3 -m crazyflie_dev.state_diagrams PAGE...`` updates the diagrams.
"""

import operator
import re
from importlib import import_module
from typing import Any

from crazyflie_takeoff.transition_table import Table, Transition, words
from crazyflie_utils.parameters.tables import update_pages

_PLACE = re.compile(r"(<!-- states: (\S+):(\S+) -->\n)(?:\n?```mermaid\n(?:.*\n)*?```\n)?")


def diagram(table: Table[Any, Any]) -> str:
    """Return a Mermaid state diagram with an arrow "event [guard] / action" for each row."""
    arrows = [
        f"    {row.state.name} --> {row.next.name}: {_label(row)}\n"
        for row in table
        if row.next is not row.state
    ]
    begin = f"stateDiagram-v2\n    [*] --> {table[0].state.name}\n"
    return f"```mermaid\n{begin}{''.join(arrows)}```\n"


def _label(row: Transition[Any, Any]) -> str:
    guard, action = words(row.guard), words(row.action)
    event = row.event.name.lower().replace("_", " ")
    return event + (f" [{guard}]" if guard else "") + (f" / {action}" if action else "")


def with_diagrams(page: str) -> str:
    """Return the text of a page with its diagrams as the code has the tables now."""

    def place(match):
        table = operator.attrgetter(match[3])(import_module(match[2]))
        return f"{match[1]}\n{diagram(table)}"

    return _PLACE.sub(place, page)


if __name__ == "__main__":
    update_pages("Update the state diagrams in pages.", with_diagrams)
