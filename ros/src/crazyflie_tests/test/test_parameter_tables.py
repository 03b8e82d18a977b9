"""The tables in the packages' READMEs name the parameters that the code reads, and no others."""

import ast
import itertools
import re

import pytest
from pages import PACKAGE_PAGES, Page

ANYTHING = ".+"


def parameters_read(package):
    """Return patterns of the names that calls of ``handle.param`` in a package ask for."""
    patterns = set()
    for file in package.glob("src/**/*.py"):
        module = ast.parse(file.read_text())
        for call in ast.walk(module):
            if isinstance(call, ast.Call) and getattr(call.func, "attr", "") == "param":
                patterns |= patterns_of(call.args[0], module)
    return patterns


def patterns_of(name, module):
    """Return regular expressions for what a name in the code may be."""
    if isinstance(name, ast.Constant):
        return {re.escape(name.value)}
    if isinstance(name, ast.JoinedStr):
        parts = [part.value if isinstance(part, ast.Constant) else None for part in name.values]
        return {"".join(ANYTHING if part is None else re.escape(part) for part in parts)}
    values = [
        node.value
        for node in ast.walk(module)
        if isinstance(node, ast.Assign)
        and getattr(node.targets[0], "id", "") == getattr(name, "id", None)
    ]
    known = [value for value in values if isinstance(value, (ast.Constant, ast.JoinedStr))]
    return set().union(*(patterns_of(value, module) for value in known))


def parameters_documented(page):
    """Return the names in the columns of parameters of a page's tables."""
    names = set()
    for table in page.tables:
        head, *rows = table.rows
        columns = [k for k, title in enumerate(head) if re.match(r"parameter\b", title)]
        names |= {name for row in rows for k in columns for name in expanded(row[k])}
    return {name for name in names if "..." not in name}


def words_in_tables(page):
    """Return all names in all tables of a page: topics stand in tables of their own."""
    cells = [cell for table in page.tables for row in table.rows for cell in row]
    return {name for cell in cells for name in expanded(cell)}


def expanded(cell):
    """Return the names in a cell.

    ``a/{x,y}`` are a/x and a/y; ``a_b, _c`` are a_b and a_c.
    """
    names = []
    for name in re.split(r", *(?![^{]*})", cell.replace("`", "")):
        if name.startswith("_") and names:
            name = names[0].rpartition("_")[0] + name
        parts = re.split(r"{([^}]*)}", name.strip().lstrip("~"))
        choices = [part.split(",") if k % 2 else [part] for k, part in enumerate(parts)]
        names += ["".join(choice) for choice in itertools.product(*choices)]
    return names


PACKAGES = [page.parent for page in PACKAGE_PAGES if parameters_read(page.parent)]


def test_names_are_expanded():
    assert expanded("`~a`, `b/{x,y}`, c") == ["a", "b/x", "b/y", "c"]
    assert expanded("~a_b_c, _d") == ["a_b_c", "a_b_d"]


def test_packages_with_parameters_are_found():
    assert {"crazyflie_simulator", "crazyflie_takeoff"} <= {path.name for path in PACKAGES}


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_table_and_code_agree(package):
    page = Page(package / "README.md")
    read = parameters_read(package)
    documented = parameters_documented(page)
    unread = {name for name in documented if not any(re.fullmatch(each, name) for each in read)}
    assert unread == set(), "documented but not read"
    mentioned = documented | words_in_tables(page)
    # A name whose beginning is open is no parameter of the node's own.
    named = {each for each in read if not each.startswith(ANYTHING)}
    unknown = {
        each for each in named if not any(re.fullmatch(f"{each}(/.*)?", name) for name in mentioned)
    }
    assert unknown == set(), "read but not documented"
