"""Draws the packages by floor from their imports and manifests; prints circles.

``python3 -m crazyflie_dev.import_graph`` writes the floors into docs/architecture.md and the
picture docs/images/packages.svg.

A package is on the floor above the highest package that it needs: that its files in ``src`` and
``exec`` import, or that its package.xml names as ``depend`` or ``exec_depend``.
"""

import argparse
import ast
import graphlib
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import rospkg
from catkin_pkg.packages import find_packages

Graph = Mapping[str, set[str]]  #: Name -> names that it needs.

PAGE = "docs/architecture.md"
PICTURE = "docs/images/packages.svg"

_BLOCK = re.compile(r"(<!-- floors: [^\n]* -->\n\n```text\n).*?(```\n)", re.DOTALL)


def top_of_repository() -> Path:
    """Return the folder that has docs and ros."""
    return Path(rospkg.RosPack().get_path("crazyflie_dev")).resolve().parents[2]


def package_graph(sources: Path) -> dict[str, set[str]]:
    """Return the packages below a folder with those of the same folder that they need."""
    found = _declared_and_imported(sources)
    return {
        name: declared & found.keys() | imported for name, (declared, imported) in found.items()
    }


def undeclared_imports(sources: Path) -> dict[str, set[str]]:
    """Return the packages that import from others without naming them in package.xml."""
    found = _declared_and_imported(sources).items()
    return {
        name: imported - declared for name, (declared, imported) in found if imported - declared
    }


def module_graph(sources: Path) -> dict[str, set[str]]:
    """Return the modules of all packages with the others that they import anywhere."""
    files = {
        ".".join(path.relative_to(folder).with_suffix("").parts).removesuffix(".__init__"): path
        for package_path, _ in _packages(sources)
        for folder in [sources / package_path / "src"]
        for path in folder.rglob("*.py")
    }
    return {
        module: {name if name in files else source for source, name in _imports(path)}
        & files.keys() - {module}
        for module, path in files.items()
    }


def circles(graph: Graph) -> list[list[str]]:
    """Return circles: lists of names, each of which needs the next, and the last the first.

    Every circle shares a name with one of them; with all of these cut, none is left.
    """
    remaining = {name: set(needed) for name, needed in graph.items()}
    found = []
    while True:
        try:
            graphlib.TopologicalSorter(remaining).prepare()
        except graphlib.CycleError as error:
            circle = error.args[1][::-1]
            found.append(circle[:-1])
            remaining[circle[0]].discard(circle[1])
        else:
            return found


def floors(graph: Graph) -> list[list[str]]:
    """Return the names by floor, the lowest first; graphlib.CycleError for a circle."""
    height: dict[str, int] = {}
    for name in graphlib.TopologicalSorter(graph).static_order():
        height[name] = max((height[each] + 1 for each in graph[name]), default=0)
    return [sorted(n for n in height if height[n] == k) for k in range(max(height.values()) + 1)]


def direct(graph: Graph) -> dict[str, set[str]]:
    """Return a graph without edges that follow from others: a-c from a-b and b-c."""
    indirect: dict[str, set[str]] = {}
    for name in graphlib.TopologicalSorter(graph).static_order():
        indirect[name] = set().union(*(graph[each] | indirect[each] for each in graph[name]))
    return {name: graph[name] - indirect[name] for name in graph}


def text_of(levels: list[list[str]]) -> str:
    """Return the floors as lines of text, the highest first."""
    lines = []
    for number, names in reversed(list(enumerate(levels))):
        row = f"{number} "
        for name in names:
            if len(row) + len(name) > 100:
                lines.append(row)
                row = "  "
            row += f" {name}"
        lines.append(row)
    return "\n".join(lines) + "\n"


def dot_of(graph: Graph) -> str:
    """Return the picture in the language of graphviz; arrows lead to what is needed.

    Names are without "crazyflie_", with which a page would be too narrow to read them.
    """
    lines = ["digraph {", '  node [shape=box, fontname="Helvetica", fontsize=11];']
    for names in floors(graph):
        boxes = (f'"{name}" [label="{name.removeprefix("crazyflie_")}"];' for name in names)
        lines.append("  { rank=same; " + " ".join(boxes) + " }")
    lines += [f'  "{name}" -> "{needed}";' for name, needed in edges(direct(graph))]
    return "\n".join([*lines, "}"]) + "\n"


def edges(graph: Graph) -> list[tuple[str, str]]:
    """Return the pairs (name, needed name), sorted."""
    return sorted((name, needed) for name in graph for needed in graph[name])


def with_floors(page: str, levels: list[list[str]]) -> str:
    """Return the text of a page with the floors in the block below its comment."""
    return _BLOCK.sub(lambda match: match[1] + text_of(levels) + match[2], page)


def shown(graph: Graph) -> dict[str, set[str]]:
    """Return a graph without packages that need none and that none needs."""
    needed = set().union(*graph.values())
    return {name: graph[name] for name in graph if graph[name] or name in needed}


def _packages(sources):
    packages = find_packages(str(sources)).items()
    return [(path, package) for path, package in packages if not package.is_metapackage()]


def _declared_and_imported(sources: Path) -> dict[str, tuple[set[str], set[str]]]:
    """Return package -> other packages in its package.xml, and those it imports from."""
    found = {package.name: (sources / path, package) for path, package in _packages(sources)}
    # A package of messages is a module of its name.
    owners = {name: name for name in found} | {
        path.stem: name for name, (folder, _) in found.items() for path in folder.glob("src/*")
    }
    needed = {}
    for name, (folder, package) in found.items():
        files = [*folder.glob("src/**/*.py"), *(f for f in folder.glob("exec/*") if f.is_file())]
        modules = {source.partition(".")[0] for file in files for source, _ in _imports(file)}
        imported = {owners[module] for module in modules if module in owners}
        needed[name] = ({each.name for each in package.exec_depends}, imported - {name})
    return needed


def _imports(file: Path) -> Iterator[tuple[str, str]]:
    """Yield the modules that a file imports from, each with the full name of what it imports."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from ((each.name, each.name) for each in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from ((node.module, f"{node.module}.{each.name}") for each in node.names)


def main() -> int:
    """Write page and picture, print circles; return 1 if there are any."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    top = top_of_repository()
    sources = top / "ros" / "src"
    graph = package_graph(sources)
    found = {"packages": circles(graph), "modules": circles(module_graph(sources))}
    for kind, lists in found.items():
        for circle in lists:
            print(f"circle of {kind}: {' -> '.join([*circle, circle[0]])}")
    if not found["packages"]:
        graph = shown(graph)
        page = top / PAGE
        page.write_text(with_floors(page.read_text(), floors(graph)))
        command = ["dot", "-Tsvg", "-o", str(top / PICTURE)]
        subprocess.run(command, input=dot_of(graph), text=True, check=True)
        print(f"floors: {PAGE}\npicture: {PICTURE}")
    return 1 if any(found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
