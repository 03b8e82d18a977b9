"""The tables of docs/safety.md name tests that exist, and limits as they are declared."""

import importlib
import re

import pytest
from test_any_input import declared_classes
from workspaces import TOP

PAGE = TOP / "docs" / "safety.md"
LIMIT = re.compile(r"`([a-z_]+/[a-z_/]+)` (-?[0-9.]+)")
FLAG = re.compile(r"`([a-z_]+)` (false|true)")


def rows():
    """Return the cells of every row of the tables, the headings aside."""
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line[1:-1].split("|")] for line in lines]
    return [row for row in cells if row[0] != "fault"]


def test_there_are_rows():
    assert len(rows()) > 25


@pytest.mark.parametrize("row", rows(), ids=lambda row: row[0][:40])
def test_every_row_names_a_test_that_exists(row):
    files = row[-1].split(", ")
    assert all((TOP / "ros" / "src" / file).is_file() for file in files), files


def declared():
    """Return the name and the default of every declared parameter, as pairs."""
    found = set()
    for path in declared_classes():
        module, _, name = path.partition(":")
        for each in getattr(importlib.import_module(module), name).declarations():
            if isinstance(each.default, bool | int | float):
                found.add((each.name, float(each.default)))
    return found


def test_limits_are_the_declared_ones():
    text = PAGE.read_text()
    told = {(name, float(value)) for name, value in LIMIT.findall(text)}
    told |= {(name, float(value == "true")) for name, value in FLAG.findall(text)}
    assert len(told) > 10
    missing = {
        (name, value)
        for name, value in told
        if not any(name == other and abs(value - default) < 1e-3 for other, default in declared())
    }
    assert missing == set()
