"""A package from a template, and the command line that makes one."""

import argparse
import datetime
import keyword
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import rospkg

from crazyflie_utils.text_file import user_path

#: The package, with ``@name@`` for what is filled in.
TEMPLATE = Path(rospkg.RosPack().get_path("crazyflie_package_generator")) / "template"

_NAME = re.compile(r"[a-z](_?[a-z0-9])+")
_FIELD = re.compile(r"@(\w+)@")
_IMPORTS = re.compile(r"(?:^from [\w.]+ import .*\n)+", re.MULTILINE)
_CONDITION = re.compile(r"^@(if|unless) messages@\n(.*?)^@end@\n", re.DOTALL | re.MULTILINE)


class GeneratorError(Exception):
    """The package cannot be made; the text says what was expected. Nothing was written."""


def check_name(what: str, name: str) -> None:
    """Check the name of a package or node (``what``), which also becomes that of a Python module.

    `GeneratorError`: it does not follow REP 144: lower case letters, digits and underscores, at
    least two characters, the first one a letter, no two underscores in a row.
    """
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        raise GeneratorError(
            f"{name!r} is not a valid name of a {what}; expected at least two lower case "
            "letters, digits and single underscores, the first a letter, the last not an "
            "underscore, not a keyword of Python (REP 144), such as wall_follower"
        )
    if name in sys.stdlib_module_names:
        raise GeneratorError(
            f"{name!r} is a module of Python itself, which a {what} of this name would hide; "
            "expected another name"
        )


@dataclass(frozen=True)
class Package:
    """Names that are filled in."""

    #: name, node: Names of the package, and of its node without ``_node``.
    name: str
    node: str
    messages: bool = False  #: Whether it has a message of its own.
    maintainer: str = "nobody yet"
    email: str = "nobody@example.com"

    def check(self) -> None:
        """Raise GeneratorError if a name, the maintainer or the email cannot be used."""
        check_name("package", self.name)
        check_name("node", self.node)
        if self.node.endswith("_node"):
            raise GeneratorError(
                f"{self.node!r} is not a valid name of a node; expected it without _node, which "
                "is added"
            )
        for what, text in (("maintainer", self.maintainer), ("email", self.email)):
            if not text.strip() or set(text) & set("<>&@\"'" if what == "maintainer" else "<>&\"'"):
                raise GeneratorError(
                    f"{text!r} is not a valid {what}; expected a text without <, > and &"
                )

    def files(self) -> Iterator[tuple[Path, str]]:
        """Yield the relative path and the text of every file."""
        for path in sorted(TEMPLATE.rglob("*.in")):
            place = path.relative_to(TEMPLATE).with_suffix("")
            if place.parts[0] == "msg" and not self.messages:
                continue
            filled = str(place).replace("PACKAGE", self.name).replace("NODE", self.node)
            yield Path(filled), self._fill(path.read_text())

    def _fill(self, text):
        text = _CONDITION.sub(
            lambda match: match[2] if (match[1] == "if") == self.messages else "", text
        )
        title = f"Changelog for package {self.name}"
        values = {
            "package": self.name,
            "node": self.node,
            "Class": "".join(word.capitalize() for word in self.node.split("_")),
            "Output": "Smoothed" if self.messages else "Float64",
            "output_type_name": f"{self.name}/Smoothed" if self.messages else "std_msgs/Float64",
            "field": "smoothed" if self.messages else "data",
            "maintainer": self.maintainer,
            "email": self.email,
            "date": datetime.date.today().isoformat(),
            "bar": "^" * len(title),
        }
        filled = _FIELD.sub(lambda match: values.get(match[1], match[0]), text)
        return _IMPORTS.sub(_in_order, filled)


def _in_order(imports):
    # The order of imports depends on the package's name.
    lines = sorted(imports[0].splitlines(keepends=True), key=lambda line: line.split()[1])
    return "".join(lines)


def create(package: Package, folder: Path) -> Path:
    """Write a package into a folder, such as a workspace's src; return the package's folder.

    `GeneratorError`: a name cannot be used, there is such a folder already, or it cannot be
    written. Nothing is left behind then.
    """
    package.check()
    if not folder.is_dir():
        raise GeneratorError(
            f"there is no folder {folder}; expected one, such as a workspace's src"
        )
    target = folder / package.name
    if target.exists() or target.is_symlink():
        raise GeneratorError(f"{target} exists already; expected the name of a new package")
    try:
        # In the same folder, so that it appears at its place at once and complete.
        with tempfile.TemporaryDirectory(prefix=f".{package.name}-", dir=folder) as unfinished:
            for place, text in package.files():
                file = Path(unfinished, package.name, place)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(text)
                if place.parts[0] == "exec":
                    file.chmod(0o755)
            os.rename(Path(unfinished, package.name), target)
    except OSError as error:
        raise GeneratorError(f"{target} cannot be written: {error}") from None
    return target


def main(arguments: list[str] | None = None) -> int:
    """Make a package as the command line asks; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="create_package",
        description="Make a package with one node that builds, passes its tests and lints.",
    )
    parser.add_argument("name", metavar="NAME", help="name of the package, such as wall_follower")
    parser.add_argument(
        "--node", required=True, metavar="NAME", help="name of its node, without _node"
    )
    parser.add_argument(
        "--messages", action="store_true", help="give the package a message of its own"
    )
    parser.add_argument(
        "--folder",
        type=user_path,
        default=Path(),
        help="folder in which the package is made (default: the current one)",
    )
    parser.add_argument("--maintainer", default=Package.maintainer, help="for package.xml")
    parser.add_argument("--email", default=Package.email, help="for package.xml")
    given = parser.parse_args(arguments)
    package = Package(given.name, given.node, given.messages, given.maintainer, given.email)
    try:
        folder = create(package, given.folder)
    except GeneratorError as error:
        print(f"create_package: {error}", file=sys.stderr)
        return 1
    print(f"{folder}: build it with catkin_make; its README.md says what it is")
    return 0
