"""Pages of the manual as Sphinx needs them; the files themselves are for GitHub and editors."""

import re
from pathlib import Path

_LINK = re.compile(r"(?<=\]\()([^)\s#]+)(#[^)\s]*)?(?=\))")
_ENTRY = re.compile(r"^(?:\| |\* )\[[^]]*\]\((?!\.\.)([^)\s#]+\.md)\)", re.MULTILINE)
_DIAGRAM = re.compile(r"```mermaid\n(stateDiagram-v2|flowchart LR)\n(.*?)```", re.DOTALL)
_TRANSITION = re.compile(r" *(\S+) --> (\w+)(?:: (.*))?")
_NODE = re.compile(r'(\w+)(?:(\[/|\(\[|\{\{)"?(.*?)"?(?:/\]|\]\)|\}\}))?')
_ARROW = re.compile(r" *--(?: (.*?) --)?> *")
_SHAPES = {"[/": "box", "([": "ellipse", "{{": "hexagon"}


def link_sources(text: str, page: Path, top: Path, sources: str) -> str:
    """Return a page whose links to files that are not pages lead to the repository.

    Parameters
    ----------
    text : str
        Of the page.
    page : Path
        Its file.
    top : Path
        Top folder of the repository.
    sources : str
        URL of that folder; a path relative to it is appended.
    """

    def target(match):
        file = (page.parent / match[1]).resolve()
        if file.suffix in {".md", ".png", ".svg"} or not file.exists():
            return match[0]
        return f"{sources}/{file.relative_to(top)}{match[2] or ''}"

    return _LINK.sub(target, text)


def contents(text: str) -> list[tuple[str, list[str]]]:
    """Return each heading of a table of contents with the pages that its tables and lists name.

    Pages of folders above do not count: packages have a heading of their own.
    """
    parts = re.split(r"^##? +(.*)$", text, flags=re.MULTILINE)
    pages = [
        (title, list(dict.fromkeys(_ENTRY.findall(body))))
        for title, body in zip(parts[1::2], parts[2::2], strict=True)
    ]
    return [(title, links) for title, links in pages if links]


def toctree(caption: str, pages: list[str]) -> str:
    """Return a directive that puts pages below a caption into the sidebar of the site."""
    return "\n".join(["", "```{toctree}", ":hidden:", f':caption: "{caption}"', *pages, "```", ""])


def draw_diagrams(text: str) -> str:
    """Return a page whose Mermaid diagrams are drawn by Graphviz, which needs no network."""
    return _DIAGRAM.sub(_graph, text)


def _graph(match):
    kind, body = match.groups()
    lines = _flowchart(body) if kind.startswith("flow") else _states(body)
    return "\n".join(["```{graphviz}", "digraph {", *lines, "}", "```"])


def _states(body):
    labels: dict[tuple[str, str], list[str]] = {}
    for begin, end, label in _TRANSITION.findall(body):
        labels.setdefault((begin, end), []).append(label)
    lines = ["node [shape=box, style=rounded, fontsize=10];", "edge [fontsize=9];"]
    for (begin, end), events in labels.items():
        if begin == "[*]":
            lines.append(f"{end} [peripheries=2];")
        else:
            text = "".join(event + r"\l" for event in events)
            lines.append(f'{begin} -> {end} [label="{text}"];')
    return lines


def _flowchart(body):
    lines = ["rankdir=LR;"]
    for row in body.splitlines():
        last, arrow, rest = None, "", row.strip()
        while node := _NODE.match(rest):
            name, shape, label = node.groups()
            if shape:
                lines.append(f'"{name}" [shape={_SHAPES[shape]}, label="{label}"];')
            if last:
                lines.append(f'"{last}" -> "{name}" [label="{arrow}"];')
            rest, last = rest[node.end() :], name
            if step := _ARROW.match(rest):
                arrow, rest = step[1] or "", rest[step.end() :]
    return lines
