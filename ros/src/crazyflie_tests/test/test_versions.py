"""All packages have one version, and each has a changelog (REP 132) whose newest release it is."""

import datetime
import re

import pytest
from catkin_pkg.package import parse_package
from catkin_pkg.packages import find_package_paths
from docutils import nodes
from docutils.core import publish_doctree
from docutils.utils import SystemMessage
from workspaces import TOP

SOURCES = TOP / "ros" / "src"
FOLDERS = [SOURCES / path for path in find_package_paths(str(SOURCES))]
RELEASE = re.compile(r"(\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)")


def releases(text, name):
    """Return the versions in a changelog, newest first.

    Raises
    ------
    AssertionError
        It does not have the form of REP 132.
    SystemMessage
        It is not reStructuredText.
    """
    strict = {"doctitle_xform": False, "halt_level": 2, "report_level": 5}
    (document,) = publish_doctree(text, settings_overrides=strict).children
    head, *sections = document.children
    assert head.astext() == f"Changelog for package {name}"
    assert text.splitlines()[2] == "^" * len(head.astext()), "the underline"
    assert all(isinstance(section, nodes.section) for section in sections)
    for section in sections:
        kinds = {type(child) for child in section.children[1:]}
        assert kinds == {nodes.bullet_list}, f"a list in {section[0].astext()}, nothing else"
    titles = [section[0].astext() for section in sections]
    if titles[0] == "Forthcoming":
        del titles[0]
    found = []
    for title in titles:
        match = RELEASE.fullmatch(title)
        assert match, f"{title!r} is not VERSION (YYYY-MM-DD)"
        found.append((datetime.date.fromisoformat(match[2]), numbers(match[1]), match[1]))
    assert found == sorted(found, reverse=True), "the newest comes first"
    return [version for _, _, version in found]


def numbers(version):
    """Return a version as numbers, which can be compared."""
    return tuple(int(number) for number in version.split("."))


GOOD = """\
^^^^^^^^^^^^^^^^^^^^^^^
Changelog for package a
^^^^^^^^^^^^^^^^^^^^^^^

Forthcoming
-----------
* More.

1.10.0 (2026-12-01)
-------------------
* This.

1.9.0 (2026-11-21)
------------------
* That
  and ``that``.
"""


def test_a_changelog_is_read():
    assert releases(GOOD, "a") == ["1.10.0", "1.9.0"]


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ("package a", "package b"),
        ("^" * 23, "=" * 23),
        ("1.10.0", "1.8.0 "),
        ("2026-12-01", "yesterday "),
        ("2026-12-01", "2026-10-01"),
        ("* More", "More"),
        ("``that``", "``that`"),
        ("Forthcoming\n-----------", "Some time   \n-----------"),
    ],
)
def test_what_is_wrong_is_noticed(good, bad):
    with pytest.raises((AssertionError, SystemMessage)):
        releases(GOOD.replace(good, bad), "a")


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_the_newest_release_in_the_changelog_is_the_version(folder):
    package = parse_package(str(folder))
    assert package.package_format == 3
    changelog = folder / "CHANGELOG.rst"
    assert changelog.is_file(), f"{package.name} needs one, see docs/contributing.md"
    assert releases(changelog.read_text(), package.name)[0] == package.version


def test_all_packages_have_the_same_version():
    versions = {folder.name: parse_package(str(folder)).version for folder in FOLDERS}
    assert len(set(versions.values())) == 1, versions
