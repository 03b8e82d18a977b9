"""Tables of parameters in the READMEs, made from the declarations.

In a page, a comment names one or more classes derived from `Parameters`, and the table
below it is theirs::

    <!-- parameters: crazyflie_takeoff.takeoff_server_node:TakeoffServerParameters -->

``python3 -m crazyflie_utils.parameters.tables PAGE...`` updates the tables.
"""

import argparse
import itertools
import re
from collections.abc import Callable
from pathlib import Path

from crazyflie_utils.parameters.declaration import REQUIRED, Declaration, Parameters
from crazyflie_utils.program import load

_PLACE = re.compile(r"(<!-- parameters: (.+?) -->\n)(?:\n?(?:\|.*\n)+)?")


def table(*classes: type[Parameters]) -> str:
    """Return a Markdown table of the parameters that classes declare.

    Parameters that differ only in their names, such as those of three axes, share a row.
    """
    rows = ["| parameter | type, unit | default | range | |", "|---|---|---|---|---|"]
    declarations = itertools.chain.from_iterable(each.declarations() for each in classes)
    names: dict[tuple[str, ...], list[str]] = {}
    for declaration in declarations:
        names.setdefault(_cells(declaration), []).append(f"`{declaration.name}`")
    rows += [f"| {' | '.join((', '.join(alike), *cells))} |" for cells, alike in names.items()]
    return "\n".join(rows) + "\n"


def _cells(declaration: Declaration) -> tuple[str, ...]:
    parameter_type = declaration.type
    live = " *(live)*" if declaration.live else ""
    return (
        ", ".join(filter(None, [parameter_type.label, parameter_type.unit])),
        _default(declaration.default),
        parameter_type.range.replace("|", "\\|"),
        declaration.help.replace("|", "\\|") + live,
    )


def _default(value):
    if value is REQUIRED:
        return "required"
    if value is None:
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    return f"`{value}`" if value not in ("", (), [], {}) else "empty"


def with_tables(page: str) -> str:
    """Return the text of a page with its tables as the code declares them now."""

    def place(match):
        return f"{match[1]}\n{table(*map(load, match[2].split()))}"

    return _PLACE.sub(place, page)


def update_pages(description: str, update: Callable[[str], str]) -> None:
    """Update the texts of the pages named on the command line, by ``update(text)``."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("pages", nargs="+", type=Path, metavar="PAGE")
    for path in parser.parse_args().pages:
        text = path.read_text()
        if (new := update(text)) != text:
            path.write_text(new)
            print(f"{path} is new")


if __name__ == "__main__":
    update_pages("Update the tables of parameters in pages.", with_tables)
