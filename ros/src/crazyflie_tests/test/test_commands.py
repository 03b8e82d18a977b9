"""The commands of the manual do what the manual says, typed as they stand into terminals."""

import re

import pytest
from pages import PAGES, Page
from reader import Reader
from workspaces import INSTALLATION, TOP

PAGES_WITH_COMMANDS = [
    path
    for path in PAGES
    if any(block.comment.startswith("run") for block in Page(path).blocks) and path != INSTALLATION
]


def test_commands_of_the_installation(workspace):
    # They are what has made the workspace.
    for space in ("devel", "install"):
        assert (workspace / "ros" / space / "setup.bash").is_file()


@pytest.mark.parametrize("path", PAGES_WITH_COMMANDS, ids=lambda path: path.name)
def test_commands_of_a_page(path, workspace, tmp_path):
    reader = Reader(workspace, tmp_path / "home")
    try:
        reader.follow(Page(path))
    finally:
        reader.close()


def test_the_picture_of_the_graph_shows_the_graph_that_runs(workspace):
    # Whatever graphviz has drawn anew when the page of the graph was tested.
    drawn = workspace / "docs" / "images" / "sw_hover_graph.svg"
    shipped = TOP / "docs" / "images" / "sw_hover_graph.svg"
    # Some versions of graphviz give the whole drawing a title, too.
    titles = [re.findall("<title>([^%].*)</title>", path.read_text()) for path in (drawn, shipped)]
    assert sorted(titles[0]) == sorted(titles[1])
