"""The commands of the manual do what the manual says, typed as they stand into terminals."""

import re
import threading
from concurrent.futures import ThreadPoolExecutor, wait

import pytest
from pages import PAGES, Page
from reader import Reader
from workspaces import INSTALLATION, TOP

PAGES_WITH_COMMANDS = [
    path
    for path in PAGES
    if any(block.comment.startswith("run") for block in Page(path).blocks) and path != INSTALLATION
]


def types(page, text):
    """Tell whether a text is among what is typed when a page is followed."""
    typed = [part for part in page.parts if isinstance(part, str)]
    typed += [block.text for block in page.blocks if block.comment.startswith("run")]
    return any(text in part for part in typed)


def calls_run(page):
    """Tell whether a page calls the script ``run``, which builds the workspace where it must."""
    return types(page, "./run ")


def length(path):
    """Return how many commands a page has."""
    blocks = Page(path).blocks
    return sum(len(block.commands) for block in blocks if block.comment.startswith("run"))


def in_turns():
    """Return lists of pages: two programs must not build one workspace at a time."""
    pages = {path: Page(path) for path in sorted(PAGES_WITH_COMMANDS, key=length, reverse=True)}
    changing = [p for p in pages if any(b.comment == "apply" for b in pages[p].blocks)]
    calling = [p for p in pages if p not in changing and calls_run(pages[p])]
    others = [p for p in pages if p not in changing and p not in calling]
    return [calling, *([path] for path in changing[:-1]), [*changing[-1:], *others]]


AT_A_TIME = 2
"""So many pages are followed at a time: flights and calls mostly wait."""

QUICK = [
    TOP / "README.md",
    TOP / "docs" / "software_example.md",
    min((TOP / "docs" / "course").glob("[0-9]*.md")),
]
"""Pages that are followed in each run of the tests, beside the one of the installation. What the
others name is tested where it is made, and that they name it rightly, in test_pages.py."""

VIRTUAL_VEHICLE = "virtual_"
"""What pages type that launch it. Its ports can be used by one of them at a time."""


def cases():
    """Return the pages as parameters of a test; most of them are long."""
    assert set(PAGES_WITH_COMMANDS) >= set(QUICK)
    return [
        pytest.param(
            path,
            id=str(path.relative_to(TOP)),
            marks=[] if path in QUICK else pytest.mark.long,
        )
        for path in PAGES_WITH_COMMANDS
    ]


@pytest.fixture(scope="module")
def followed(workspace, request, tmp_path_factory):
    """Return the pages to test, each with a future that is done when it has been followed."""
    ports = threading.Lock()
    params = [getattr(item, "callspec", None) for item in request.session.items]
    # The picture of the graph, if it is tested alone, needs them all.
    chosen = [spec.params["path"] for spec in params if spec and "path" in spec.params]
    chosen = chosen or PAGES_WITH_COMMANDS

    def follow(path):
        page = Page(path)
        if types(page, VIRTUAL_VEHICLE):
            with ports:
                read(page)
        else:
            read(page)

    def read(page):
        reader = Reader(workspace, tmp_path_factory.mktemp("home"))
        try:
            reader.follow(page)
        finally:
            reader.close()

    with ThreadPoolExecutor(AT_A_TIME) as executor:
        futures = {}
        for pages in in_turns():
            wait(futures.values())
            futures |= {path: executor.submit(follow, path) for path in pages if path in chosen}
        yield futures


def test_commands_of_the_installation(workspace):
    # They are what has made the workspace.
    for space in ("devel", "install"):
        assert (workspace / "ros" / space / "setup.bash").is_file()


@pytest.mark.parametrize("path", cases())
def test_commands_of_a_page(path, followed):
    # The reader asserts that each command succeeds and prints what the page says; it raises here.
    assert followed[path].result() is None


@pytest.mark.long
@pytest.mark.usefixtures("followed")
def test_the_picture_of_the_graph_shows_the_graph_that_runs(workspace):
    # Whatever graphviz has drawn anew when the page of the graph was tested.
    drawn = workspace / "docs" / "images" / "sw_hover_graph.svg"
    shipped = TOP / "docs" / "images" / "sw_hover_graph.svg"
    # Some versions of graphviz give the whole drawing a title, too.
    titles = [re.findall("<title>([^%].*)</title>", path.read_text()) for path in (drawn, shipped)]
    assert sorted(titles[0]) == sorted(titles[1])
