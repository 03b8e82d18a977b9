"""The pages of the manual, taken apart."""

import re
from dataclasses import dataclass, field
from pathlib import Path

from workspaces import TOP

PAGES = [
    TOP / "README.md",
    *sorted((TOP / "docs").glob("*.md")),
    *sorted((TOP / "docs" / "course").glob("*.md")),
    *sorted((TOP / "docs" / "course" / "solutions").glob("*.md")),
]
"""The pages whose commands are run."""

# Tools keep README files in hidden folders, as pytest does in .pytest_cache.
PACKAGE_PAGES = [
    *(
        p
        for p in sorted((TOP / "ros").glob("src/**/README.md"))
        if not p.parent.name.startswith(".")
    ),
    TOP / "ros" / "launch_shared" / "README.md",
]

_COMMENT = re.compile(r"<!-- (.*) -->")
_NOT_RUN = "*Not run by the tests: "


@dataclass
class Block:
    """A fenced block.

    Attributes
    ----------
    line : int
        Where it begins.
    language : str
    comment : str
        Of the HTML comment above it; empty without one.
    lines : list of str
    excuse : str
        Why it is not run, as the text below says; empty if it does not.
    """

    line: int
    language: str
    comment: str
    lines: list = field(default_factory=list)
    excuse: str = ""

    @property
    def text(self) -> str:
        """Text of the block."""
        return "\n".join(self.lines)

    @property
    def commands(self) -> list[str]:
        """Its commands; one may go on in the next line."""
        return [line for line in self.text.replace("\\\n", "").split("\n") if line.strip()]


@dataclass
class Table:
    """A table.

    Attributes
    ----------
    comment : str
        Of the HTML comment above it.
    rows : list of list of str
        Cells; the first row is the head, the line below it is left out.
    """

    comment: str
    rows: list


class Page:
    """A Markdown file: ``parts`` are blocks, tables, comments (str) in their order."""

    def __init__(self, path: Path):
        self.path = path
        self.parts = []
        self.prose = []
        self.indented = []
        self._read(path.read_text().splitlines())

    @property
    def blocks(self) -> list[Block]:
        """All fenced blocks."""
        return [part for part in self.parts if isinstance(part, Block)]

    @property
    def tables(self) -> list[Table]:
        """All tables."""
        return [part for part in self.parts if isinstance(part, Table)]

    @property
    def headings(self) -> set[str]:
        """Anchors of the headings, as Markdown viewers make them."""
        titles = [line.lstrip("#").strip() for line in self.prose if line.startswith("#")]
        return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}

    def _read(self, lines):
        comment, fence, last = "", None, None
        for number, line in enumerate(lines, start=1):
            if fence is not None:
                if line.startswith("```"):
                    fence = None
                else:
                    fence.lines.append(line)
            elif line.startswith("```"):
                fence = last = Block(number, line[3:], comment)
                self.parts.append(fence)
                comment = ""
            elif match := _COMMENT.fullmatch(line):
                comment = match.group(1)
                self.parts.append(comment)
            elif line.startswith("|"):
                self._add_row(line, comment)
                comment = ""
            else:
                self._read_prose(number, line, last)
                if line.strip():
                    comment = ""
            self._was_table = line.startswith("|")

    def _add_row(self, line, comment):
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        self.prose.append(line)
        if not self._was_table:
            self.parts.append(Table(comment, [cells]))
        elif not all(re.fullmatch(r":?-+:?", cell) for cell in cells):
            self.parts[-1].rows.append(cells)

    def _read_prose(self, number, line, last):
        is_after_blank = not self.prose or not self.prose[-1].strip()
        if line.startswith("    ") and line.strip() and is_after_blank:
            self.indented.append(number)
        if _NOT_RUN in line and last is not None:
            last.excuse = line.partition(_NOT_RUN)[2]
        self.prose.append(line)
