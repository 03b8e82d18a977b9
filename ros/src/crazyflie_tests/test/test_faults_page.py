"""The tables of docs/faults.md name tests that exist, and limits as they are declared."""

import ast
import functools
import importlib
import re

import pytest
from test_any_input import declared_classes
from workspaces import TOP

PAGE = TOP / "docs" / "faults.md"
LIMIT = re.compile(r"`([a-z_]+/[a-z_/]+)` (-?[0-9.]+)")
FLAG = re.compile(r"`([a-z_]+)` (false|true)")
LINK = re.compile(r"\[([^]]+)\]\(\.\./ros/src/([^)]+)\)")


def rows():
    """Return the cells of every row of the tables, the headings aside.

    A row of the table of guards has its name, what it does, and its test, as the others.
    """
    lines = [line for line in PAGE.read_text().splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line[1:-1].split("|")] for line in lines]
    rows = [row if len(row) != 6 else [row[0], " ".join(row[1:5]), row[5]] for row in cells]
    return [row for row in rows if row[0] not in ("fault", "guard")]


def test_there_are_rows():
    assert len(rows()) > 100


def test_every_row_has_a_fault_what_happens_and_links_to_tests():
    wrong = [row[0] for row in rows() if len(row) != 3 or LINK.sub("", row[2]).strip(", ")]
    assert wrong == [], (
        "| fault | what happens | [words of the test's name](../ros/src/FILE), ... |"
    )


@functools.cache
def functions(path):
    """Return the functions of a module by name."""
    body = ast.parse(path.read_text()).body
    return {each.name: each for each in body if isinstance(each, ast.FunctionDef)}


def checks(function):
    """Tell whether a test can fail: it asserts, expects an error, or calls what may."""
    nodes = (node for statement in function.body for node in ast.walk(statement))
    return any(isinstance(node, ast.Assert | ast.With | ast.Call) for node in nodes)


@pytest.mark.parametrize("row", rows(), ids=lambda row: row[0][:40])
def test_every_row_names_test_functions(row):
    links = LINK.findall(row[-1])
    assert links, row[-1]
    for words, file in links:
        name = "test_" + words.replace(" ", "_")
        path = TOP / "ros" / "src" / file
        assert path.is_file(), file
        assert name in functions(path), f"{file} has no {name}"
        assert checks(functions(path)[name]), name


def test_an_empty_test_checks_nothing():
    empty = ast.parse("def test_nothing():\n    'Fly.'\n    pass\n").body[0]
    assert not checks(empty)


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
