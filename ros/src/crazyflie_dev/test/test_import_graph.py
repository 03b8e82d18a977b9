"""The packages need each other in one direction, and the architecture page shows how."""

import re

import pytest

from crazyflie_dev.import_graph import (
    PAGE,
    PICTURE,
    circles,
    direct,
    edges,
    floors,
    module_graph,
    package_graph,
    shown,
    text_of,
    top_of_repository,
    undeclared_imports,
    with_floors,
)

TOP = top_of_repository()
SOURCES = TOP / "ros" / "src"
HINT = "run python3 -m crazyflie_dev.import_graph"


@pytest.fixture(scope="module")
def packages():
    return package_graph(SOURCES)


def test_circles_are_found():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": {"d", "e"}, "e": set()}
    assert sorted(map(sorted, circles(graph))) == [["b", "c"], ["d"]]
    assert circles({"a": {"b"}, "b": set()}) == []


def test_floors_and_direct_edges():
    graph = {"top": {"middle", "low"}, "middle": {"low"}, "low": set(), "other": set()}
    assert floors(graph) == [["low", "other"], ["middle"], ["top"]]
    assert edges(direct(graph)) == [("middle", "low"), ("top", "middle")]
    assert text_of(floors(graph)) == "2  top\n1  middle\n0  low other\n"
    assert "other" not in shown(graph)


def package(folder, name, code, needed=""):
    (folder / name / "src" / name).mkdir(parents=True)
    (folder / name / "src" / name / "__init__.py").write_text("")
    (folder / name / "src" / name / "module.py").write_text(code)
    depend = f"<exec_depend>{needed}</exec_depend>" if needed else ""
    (folder / name / "package.xml").write_text(
        f"<package format='3'><name>{name}</name><version>1.0.0</version>"
        "<description>d</description>"
        f"<maintainer email='a@b.de'>m</maintainer><license>l</license>{depend}</package>"
    )


def test_graphs_of_a_workspace(tmp_path):
    package(tmp_path, "upper", "import lower.module\nfrom middle import module", "messages")
    package(tmp_path, "middle", "import os")
    package(tmp_path, "lower", "")
    package(tmp_path, "messages", "")
    graph = package_graph(tmp_path)
    assert edges(graph) == [("upper", "lower"), ("upper", "messages"), ("upper", "middle")]
    assert undeclared_imports(tmp_path) == {"upper": {"lower", "middle"}}
    (tmp_path / "middle/src/middle/typed.py").write_text(
        "if TYPE_CHECKING:\n    from middle.module import X\ndef f():\n    import middle.other"
    )
    modules = [
        ("middle.typed", "middle.module"),
        ("upper.module", "lower.module"),
        ("upper.module", "middle.module"),
    ]
    assert edges(module_graph(tmp_path)) == modules


def test_no_circle_of_packages(packages):
    assert circles(packages) == []


def test_no_circle_of_modules_even_for_types_or_within_a_function():
    graph = module_graph(SOURCES)
    assert len(graph) > 200
    assert circles(graph) == []


def test_imports_are_declared():
    assert undeclared_imports(SOURCES) == {}


def test_no_package_needs_what_is_not_installed(packages):
    users = {
        name for name, needed in packages.items() if needed & {"crazyflie_dev", "crazyflie_tests"}
    }
    assert users == set()


def test_the_page_shows_the_floors(packages):
    text = (TOP / PAGE).read_text()
    assert with_floors(text, floors(shown(packages))) == text, HINT


def test_the_picture_shows_the_packages(packages):
    titles = re.findall(
        r"<title>(\w+)(?:-|&#45;)(?:>|&gt;)(\w+)</title>", (TOP / PICTURE).read_text()
    )
    assert sorted(titles) == edges(direct(shown(packages))), HINT
