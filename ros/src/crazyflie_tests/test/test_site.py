"""The pages as Sphinx gets them."""

import subprocess
import sys

import pytest
from workspaces import TOP

sys.path.insert(0, str(TOP / "docs" / "site"))
import site_pages

PAGE = TOP / "docs" / "README.md"


def linked(text):
    """Return a text in docs/README.md as it is in the site."""
    return site_pages.link_sources(text, PAGE, TOP, "https://host/blob/main")


def test_a_link_to_a_source_leads_to_the_repository():
    assert linked("[a](../run), [b](examples/odometer), [c](../ros/src/x.py#L3)") == (
        "[a](https://host/blob/main/run), [b](https://host/blob/main/docs/examples/odometer), "
        "[c](../ros/src/x.py#L3)"
    )


def test_links_to_pages_pictures_and_hosts_stay():
    text = "[a](safety.md#stop) ![b](images/frames.svg) [c](https://www.ros.org) [d](#here)"
    assert linked(text) == text


def test_headings_with_links_are_the_contents():
    page = "# Title\n\nText [a](a.md).\n\n## One\n\n| [b](b.md) | text [c](c.md) |\n* [d](d/e.md)\n"
    other = "\n## Two\n\n| [f](../ros/README.md) | |\n"
    assert site_pages.contents(page + other) == [("One", ["b.md", "d/e.md"])]


def test_the_first_page_names_all_groups():
    groups = dict(site_pages.contents(PAGE.read_text()))
    assert sum(map(len, groups.values())) > 15


def test_transitions_between_two_states_share_an_arrow():
    page = (
        "```mermaid\nstateDiagram-v2\n    [*] --> A\n    A --> B: go / push\n    A --> B: on\n```"
    )
    lines = site_pages.draw_diagrams(page).splitlines()
    assert "A [peripheries=2];" in lines
    assert 'A -> B [label="go / push\\lon\\l"];' in lines


def test_a_flowchart_is_a_graph():
    chart = "flowchart LR\n  a([node]) --> t[/topic/] -- label --> s{{service}}\n  t --> a\n"
    page = f"```mermaid\n{chart}```"
    lines = site_pages.draw_diagrams(f"before\n{page}\nafter").splitlines()
    assert lines[:4] == ["before", "```{graphviz}", "digraph {", "rankdir=LR;"]
    assert '"a" [shape=ellipse, label="node"];' in lines
    assert '"a" -> "t" [label=""];' in lines
    assert '"t" -> "s" [label="label"];' in lines
    assert '"t" -> "a" [label=""];' in lines
    assert lines[-3:] == ["}", "```", "after"]


# Links are found by test_pages.py; the rest is what Sphinx and the docstrings make of each other.
@pytest.mark.long
def test_sphinx_has_no_warning(tmp_path):
    pytest.importorskip("sphinx", reason="./run docs installs it")
    folders = ["-c", TOP / "docs" / "site", "-d", tmp_path / "doctrees", TOP, tmp_path / "site"]
    result = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", *map(str, folders)],
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "site" / "index.html").is_file()
