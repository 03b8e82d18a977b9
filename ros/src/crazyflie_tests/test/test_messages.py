"""Messages that the README of the driver explains are messages that the code gives."""

import ast
import re

import pytest
from pages import Page
from workspaces import TOP

PAGE = TOP / "ros" / "src" / "crazyflie_ros" / "crazyflie_driver" / "README.md"


def explained():
    """Return the messages in the first column of the page's tables of messages."""
    tables = [table for table in Page(PAGE).tables if table.rows[0][0] == "message"]
    return [row[0].strip("`") for table in tables for row in table.rows[1:]]


@pytest.fixture(scope="module")
def texts():
    """Return all texts in the workspace's modules; what is filled in is a null character."""
    found = set()
    for path in (TOP / "ros").glob("src/**/src/**/*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.JoinedStr):
                parts = [getattr(part, "value", "\0") for part in node.values]
                found.add("".join(part if isinstance(part, str) else "\0" for part in parts))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(node.value)
    return found


def test_there_are_messages():
    assert len(explained()) > 20


@pytest.mark.parametrize("message", explained())
def test_the_code_gives_it(texts, message):
    pattern = re.compile(re.escape(message).replace(re.escape("..."), ".*\0.*"), re.DOTALL)
    assert any(pattern.search(text) for text in texts)
