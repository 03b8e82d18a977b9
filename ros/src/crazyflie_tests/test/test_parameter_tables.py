"""The tables of parameters are as the code declares them, and every node has one."""

import ast
import functools
import re

import pytest
from pages import PACKAGE_PAGES, PAGES
from workspaces import TOP

from crazyflie_utils.parameters.tables import with_tables

COMMENT = re.compile(r"<!-- parameters: (.+?) -->")


def documented():
    """Return the pages with tables, and the names of the classes that they document."""
    found = {page: COMMENT.findall(page.read_text()) for page in [*PAGES, *PACKAGE_PAGES]}
    names = {path.rpartition(":")[2] for each in found.values() for path in " ".join(each).split()}
    return [page for page, comments in found.items() if comments], names


@functools.cache
def syntax():
    """Return all nodes of the syntax trees of the packages' modules."""
    files = (TOP / "ros" / "src").glob("**/src/**/*.py")
    return [node for file in files for node in ast.walk(ast.parse(file.read_text()))]


def classes_that_nodes_load():
    """Return the names of the classes that are given to ``handle.load`` or ``Node[...]``.

    A class attribute in their place, such as ``self.parameters_type``, stands for all its values.
    """
    declared = {
        base.slice.id
        for owner in syntax()
        if isinstance(owner, ast.ClassDef)
        for base in owner.bases
        if isinstance(base, ast.Subscript) and isinstance(base.slice, ast.Name)
    }
    declared = {name for name in declared if "Parameters" in full_ancestry(name)}
    given = [
        call.args[0]
        for call in syntax()
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr == "load"
        and ast.unparse(call.func.value).endswith("handle")
    ]
    attributes = {each.attr for each in given if isinstance(each, ast.Attribute)}
    return (
        declared
        | {each.id for each in given if isinstance(each, ast.Name)}
        | {
            statement.value.id
            for owner in syntax()
            if isinstance(owner, ast.ClassDef)
            for statement in owner.body
            if isinstance(statement, ast.Assign | ast.AnnAssign)
            and isinstance(statement.value, ast.Name)
            and attributes & {target.id for target in targets(statement)}
        }
    )


def targets(statement):
    """Return what an assignment in the body of a class assigns to."""
    return statement.targets if isinstance(statement, ast.Assign) else [statement.target]


@functools.cache
def bases():
    """Return the names of the base classes of every class, by its name."""
    return {
        node.name: {base.id for base in node.bases if isinstance(base, ast.Name)}
        for node in syntax()
        if isinstance(node, ast.ClassDef)
    }


def full_ancestry(name):
    """Return the names of a class and of all that it is derived from."""
    return {name}.union(*map(full_ancestry, bases().get(name, ())))


def ancestry(name):
    """Return the names of a class and of all that it is derived from, except `Parameters`."""
    return full_ancestry(name) - {"Parameters"}


@pytest.mark.parametrize("page", documented()[0], ids=lambda page: str(page.relative_to(TOP)))
def test_tables_are_as_declared(page):
    text = page.read_text()
    hint = f"run python3 -m crazyflie_utils.parameters.tables {page}"
    assert text == with_tables(text), hint


def test_nodes_are_found():
    assert {"TakeoffServerParameters", "MergerParameters"} <= classes_that_nodes_load()


@pytest.mark.parametrize("name", sorted(classes_that_nodes_load()))
def test_every_node_has_a_table(name):
    # Nodes of one family share a table.
    assert ancestry(name) & set().union(*map(ancestry, documented()[1]))
