"""The tables of parameters in the packages' READMEs name what the code reads, and no more."""

import ast
import itertools
import re

import pytest
from pages import PACKAGE_PAGES, Page


def parameters_read(package):
    """Return patterns of the names that calls of ``handle.param`` in a package ask for."""
    patterns = set()
    for file in package.glob("src/**/*.py"):
        for call in ast.walk(ast.parse(file.read_text())):
            if isinstance(call, ast.Call) and getattr(call.func, "attr", "") == "param":
                patterns |= pattern(call.args[0])
    return patterns


def pattern(name):
    """Return the regular expression for a name in the code; none if it is just a variable."""
    if isinstance(name, ast.Constant):
        return {re.escape(name.value)}
    if isinstance(name, ast.JoinedStr):
        parts = [next(iter(pattern(part)), ".+") for part in name.values]
        return {"".join(parts)}
    return set()


def parameters_documented(page):
    """Return the names in the first columns of the tables of parameters."""
    names = set()
    for table in page.tables:
        if table.rows[0][0].startswith("parameter"):
            cells = [row[0].replace("`", "") for row in table.rows[1:]]
            names |= {name for cell in cells for name in expanded(cell)}
    return names


def expanded(cell):
    """Return the names in a cell such as "~a, b/{x,y}"."""
    names = []
    for name in re.split(r", *(?![^{]*})", cell):
        parts = re.split(r"{([^}]*)}", name.lstrip("~"))
        choices = [part.split(",") if k % 2 else [part] for k, part in enumerate(parts)]
        names += ["".join(choice) for choice in itertools.product(*choices)]
    return names


PACKAGES = [page.parent for page in PACKAGE_PAGES if parameters_read(page.parent)]


def test_names_are_expanded():
    assert expanded("~a, b/{x,y}, c") == ["a", "b/x", "b/y", "c"]


def test_packages_with_parameters_are_found():
    assert {"crazyflie_simulator", "crazyflie_takeoff"} <= {path.name for path in PACKAGES}


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_table_and_code_agree(package):
    read = parameters_read(package)
    documented = parameters_documented(Page(package / "README.md"))
    unread = {name for name in documented if not any(re.fullmatch(each, name) for each in read)}
    assert unread == set(), "documented but not read"
    unknown = {each for each in read if not any(re.fullmatch(each, name) for name in documented)}
    assert unknown == set(), "read but not documented"
