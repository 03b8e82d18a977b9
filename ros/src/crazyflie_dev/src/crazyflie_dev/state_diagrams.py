"""State diagrams and tables of guards in pages, made from the tables that run.

In a page, a comment names a table of guards (`crazyflie_takeoff.guards`); the Mermaid diagram, or
the table, below it is made of its rows. A diagram begins with the first phase of the first row::

    <!-- states: crazyflie_takeoff.guards:GUARDS -->
    <!-- guards: crazyflie_takeoff.guards:GUARDS test/test_guards.py -->

The table links to each guard's test in the file that is named: that of ``no control`` is
``test_no_control``.

``python3 -m crazyflie_dev.state_diagrams PAGE...`` updates them.
"""

import operator
import re
from collections import defaultdict
from collections.abc import Sequence
from importlib import import_module

from crazyflie_takeoff.guards import Guard
from crazyflie_utils.parameters.tables import update_pages

_PLACE = re.compile(
    r"(<!-- (?:states|guards): (\S+):(\S+)(?: (\S+))? -->\n)"
    r"(?:\n?```mermaid\n(?:.*\n)*?```\n|\n?(?:\|.*\n)+)?"
)


def diagram(table: Sequence[Guard]) -> str:
    """Return a Mermaid state diagram; an arrow has the names of all guards that lead its way."""
    names = defaultdict(list)
    for row in table:
        for phase in row.phases:
            if phase is not row.next:
                names[phase, row.next].append(row.name)
    arrows = [f"    {a.name} --> {b.name}: {', '.join(each)}\n" for (a, b), each in names.items()]
    begin = f"stateDiagram-v2\n    [*] --> {next(iter(type(table[0].next).__members__))}\n"
    return f"```mermaid\n{begin}{''.join(arrows)}```\n"


def guard_table(table: Sequence[Guard], tests: str) -> str:
    """Return a Markdown table with a row for each guard; ``tests`` is the file of their tests."""
    rows = [
        f"| {row.name} | {_phases(row)} | {_after(row)} | `{row.next.name}` | {_says(row)} | "
        f"[{row.name}]({tests}) |\n"
        for row in table
    ]
    return "| guard | in | after | next | says | test |\n|---|---|---|---|---|---|\n" + "".join(
        rows
    )


def _phases(row):
    return ", ".join(f"`{phase.name}`" for phase in row.phases)


def _after(row):
    if isinstance(row.after, str):
        return ", ".join(f"`{name}`" for name in row.after.split(", "))
    return f"{row.after:g} s" if row.after else ""


def _says(row):
    return row.says.replace("{}", "...").replace("{cause}", "...")


def with_diagrams(page: str) -> str:
    """Return the text of a page with its diagrams and tables as the code has them now."""

    def place(match):
        table = operator.attrgetter(match[3])(import_module(match[2]))
        made = diagram(table) if match[4] is None else guard_table(table, match[4])
        return f"{match[1]}\n{made}"

    return _PLACE.sub(place, page)


if __name__ == "__main__":
    update_pages("Update the state diagrams and tables of guards in pages.", with_diagrams)
