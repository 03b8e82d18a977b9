"""The commands of the manual do what the manual says, typed as they stand into terminals."""

import re
import threading
from concurrent.futures import ThreadPoolExecutor, wait

import pytest
import workspaces
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


def in_turns(paths):
    """Return lists of pages: two programs must not build one workspace at a time."""
    pages = {path: Page(path) for path in sorted(paths, key=length, reverse=True)}
    quick = [p for p in pages if p in QUICK]
    changing = [p for p in pages if any(b.comment == "apply" for b in pages[p].blocks)]
    calling = [p for p in pages if p not in quick + changing and calls_run(pages[p])]
    others = [p for p in pages if p not in quick + changing + calling]
    return [quick + calling, *([path] for path in changing[:-1]), changing[-1:] + others]


AT_A_TIME = 2
"""So many pages are followed at a time: flights and calls mostly wait."""

QUICK = [
    TOP / "README.md",
    TOP / "docs" / "software_example.md",
    TOP / "docs" / "course" / "02_a_package.md",
]
"""Pages that are followed in each run of the tests. They change
nothing of the workspace, so they are followed in a view of it, and nothing is built for them. What
the others name is tested where it is made, and that they name it rightly, in test_pages.py."""

VIRTUAL_VEHICLE = "virtual_"
"""In the commands of pages that launch it. One of them at a time can use its ports."""


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


def chosen_pages(items):
    """Return the pages that tests follow; all for the picture of the graph tested alone."""
    name = test_commands_of_a_page.__name__
    chosen = [item.callspec.params["path"] for item in items if item.originalname == name]
    return chosen or PAGES_WITH_COMMANDS


@pytest.fixture(scope="module")
def followed(request, tmp_path_factory):
    """Return the pages to test, each with a future that is done when it has been followed."""
    ports = threading.Lock()
    chosen = chosen_pages(request.session.items)
    view = workspaces.view(tmp_path_factory.mktemp("view"))
    copy = None if set(chosen) <= set(QUICK) else request.getfixturevalue("workspace")

    def follow(path):
        page = Page(path)
        top = view if path in QUICK else copy
        if types(page, VIRTUAL_VEHICLE):
            with ports:
                read(page, top)
        else:
            read(page, top)

    def read(page, top):
        reader = Reader(top, tmp_path_factory.mktemp("home"))
        try:
            reader.follow(page)
        finally:
            reader.close()

    with ThreadPoolExecutor(AT_A_TIME) as executor:
        futures = {}
        for pages in in_turns(chosen):
            wait(futures.values())
            futures |= {path: executor.submit(follow, path) for path in pages}
        yield futures


def test_only_pages_whose_commands_are_tested_are_followed(request):
    # Tests of other modules have pages as parameters, too.
    tested = [item for item in request.session.items if "test_commands_of_a_page[" in item.name]
    assert not tested or len(chosen_pages(request.session.items)) == len(tested)


@pytest.mark.parametrize("path", cases())
def test_commands_of_a_page(path, followed):
    # The reader asserts that each command succeeds and prints what the page says; it raises here.
    assert followed[path].result() is None


@pytest.mark.long
@pytest.mark.usefixtures("followed")
def test_the_picture_of_the_graph_shows_the_graph_that_runs(workspace):
    # Drawings that graphviz has changed when the page of the graph was tested.
    drawn = workspace / "docs" / "images" / "sw_hover_graph.svg"
    shipped = TOP / "docs" / "images" / "sw_hover_graph.svg"
    # Some versions of graphviz give the whole drawing a title, too.
    titles = [re.findall("<title>([^%].*)</title>", path.read_text()) for path in (drawn, shipped)]
    assert sorted(titles[0]) == sorted(titles[1])
