"""The manual agrees with the workspace: commands, code, links, tables."""

import re
from xml.etree import ElementTree

import pytest
from catkin_pkg.packages import find_package_paths
from pages import PACKAGE_PAGES, PAGES, Block, Page
from workspaces import TOP

COMMANDS = {"./run", "apt", "catkin_make", "git", "pip", "python3", "source", "sudo"}
ROS_COMMAND = re.compile(r"ros(launch|run|service|topic|param|node|msg|bag|test|pack|core)")
CODE_SPAN = re.compile(r"`([^`]+)`")
RUN = re.compile("run$|run: until /[a-z0-9_/]+$|run: until it prints .+$")
IMPORT = re.compile(r"^[+ ]*(from crazyflie_[a-z_.]+ import [A-Za-z_, ]+)$", re.M)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def named(paths):
    """Return a parametrization by the names of pages."""
    return pytest.mark.parametrize("path", paths, ids=lambda path: str(path.relative_to(TOP)))


def is_command(text):
    """Tell whether text is a command and not only the name of a program."""
    program, _, arguments = text.strip().partition(" ")
    return bool(arguments) and (program in COMMANDS or ROS_COMMAND.fullmatch(program) is not None)


def is_in(excerpt, source):
    """Tell whether lines stand together in a file, but for indentation and empty lines."""
    excerpt, source = ([line for line in lines if line.strip()] for lines in (excerpt, source))
    for start in range(len(source) - len(excerpt) + 1):
        indentation = source[start].partition(excerpt[0])[0]
        if not indentation.strip() and source[start : start + len(excerpt)] == [
            indentation + line for line in excerpt
        ]:
            return True
    return False


def unmarked(page):
    """Return what is wrong with the commands of a page, by lines."""
    complaints = {number: "code that is not fenced" for number in page.indented}
    for block in page.blocks:
        if not block.language:
            complaints[block.line] = "no language"
        elif block.language != "sh" and any(map(is_command, block.lines)):
            complaints[block.line] = "commands belong into a block of the language sh"
        elif block.language == "sh" and not (RUN.match(block.comment) or block.excuse):
            complaints[block.line] = "commands are neither run nor is it said why not"
    return complaints


BAD_PAGE = """
    roslaunch a b.launch

```
code
```

```text
rosservice call /takeoff
```

```sh
true
```

The above is not run. `rosrun a b` is.

<!-- run -->

```sh
true
```

```sh
true
```

*Not run by the tests: it is futile.*
"""


def test_commands_that_are_not_marked_are_found(tmp_path):
    file = tmp_path / "bad.md"
    file.write_text(BAD_PAGE)
    assert list(unmarked(Page(file))) == [2, 4, 8, 12]


@named(PAGES)
def test_every_command_is_run_or_says_why_not(path):
    assert unmarked(Page(path)) == {}


@pytest.fixture(scope="module")
def commands():
    """Return the commands in the blocks of all pages."""
    blocks = [block for path in PAGES for block in Page(path).blocks if block.language == "sh"]
    return {command for block in blocks for command in block.commands}


@named(PAGES)
def test_a_command_in_a_sentence_stands_in_a_block_as_well(path, commands):
    spans = CODE_SPAN.findall("\n".join(Page(path).prose))
    assert {span for span in spans if is_command(span)} <= commands


@named(PAGES)
def test_code_stands_so_in_its_file(path):
    for block in Page(path).blocks:
        where = f"{path.name}, line {block.line}"
        if block.comment.startswith("from: "):
            source = (TOP / block.comment.removeprefix("from: ")).read_text()
            assert is_in(block.lines, source.splitlines()), where
        elif not block.comment.startswith("states: "):
            assert block.language in ("sh", "text", "diff"), (
                f"{where}: say from which file the code is"
            )


EXAMPLES = sorted((TOP / "docs").glob("**/*.py"))


@named([*PAGES, *PACKAGE_PAGES, *EXAMPLES])
def test_names_that_readers_import_exist(path):
    for statement in IMPORT.findall(path.read_text()):
        exec(statement, {})


@named([*PAGES, *PACKAGE_PAGES])
def test_links_lead_somewhere(path):
    page = Page(path)
    prose = CODE_SPAN.sub("", "\n".join(page.prose))
    for link in LINK.findall(prose):
        if re.match("[a-z]+:", link):
            continue
        target, _, anchor = link.partition("#")
        file = (path.parent / target).resolve() if target else path
        assert file.exists(), link
        if anchor:
            assert anchor in Page(file).headings, link


def links_of(path):
    """Return the files of the repository to which a page has links, images among them."""
    prose = CODE_SPAN.sub("", "\n".join(Page(path).prose))
    targets = {link.partition("#")[0] for link in LINK.findall(prose) if "://" not in link}
    return {(path.parent / target).resolve() for target in targets if target}


def test_links_from_the_first_page_lead_to_every_page():
    pages = {path.resolve() for path in [*PAGES, *PACKAGE_PAGES]}
    reached, following = set(), {TOP / "docs" / "README.md"}
    while following:
        reached |= following
        following = (set().union(*map(links_of, following)) & pages) - reached
    assert {str(path.relative_to(TOP)) for path in pages - reached} == set()


def test_every_picture_is_on_a_page():
    shown = set().union(*map(links_of, [*PAGES, *PACKAGE_PAGES]))
    pictures = {*(TOP / "docs").glob("**/images/*"), *(TOP / "ros" / "src").glob("**/images/*")}
    assert {
        str(path.relative_to(TOP)) for path in pictures - shown if path.suffix != ".py"
    } == set()


@named(PAGES)
def test_comments_are_understood(path):
    page = Page(path)
    known = (
        f"{RUN.pattern}|prints$|end$|apply$|every shell: |from: |arguments of: |states: |guards: "
    )
    for part in page.parts:
        assert not isinstance(part, str) or re.match(known, part), part
    for comment, follower in zip(page.parts, page.parts[1:], strict=False):
        if isinstance(comment, str) and comment.startswith(("run", "prints", "from: ")):
            assert isinstance(follower, Block), f"{comment}: there is no block below"
            assert follower.comment == comment


TABLES = [
    (path, table)
    for path in [*PAGES, *PACKAGE_PAGES]
    for table in Page(path).tables
    if table.comment.startswith("arguments of: ")
]


@pytest.mark.parametrize(("path", "table"), TABLES, ids=lambda part: getattr(part, "name", ""))
def test_tables_of_arguments_agree_with_the_launch_file(path, table):
    file = TOP / table.comment.removeprefix("arguments of: ")
    arguments = ElementTree.parse(file).getroot().findall("arg")
    expected = {
        arg.get("name"): arg.get("default") for arg in arguments if arg.get("value") is None
    }
    documented = {name.strip("`"): default.strip("`") for name, default, *_ in table.rows[1:]}
    for name, default in expected.items():
        # A formula is described in words.
        if default is not None and default.startswith("$(eval") and documented.get(name):
            expected[name] = documented[name]
    assert documented == expected


def test_the_launch_file_of_the_software_example_has_its_table():
    files = [table.comment for _, table in TABLES]
    assert "arguments of: ros/src/crazyflie_examples/launch/sw_hover.launch" in files


MODULE_TABLES = [
    (path, table)
    for path in PACKAGE_PAGES
    for table in Page(path).tables
    if table.rows[0][0].startswith("module")
]


@pytest.mark.parametrize(("path", "table"), MODULE_TABLES, ids=lambda p: getattr(p, "name", ""))
def test_modules_in_tables_exist(path, table):
    exist = {each.stem for each in path.parent.glob("src/**/*")}
    named = {name.strip("/") for row in table.rows[1:] for name in CODE_SPAN.findall(row[0])}
    assert named - exist == set()
    assert named


@pytest.mark.parametrize("path", find_package_paths(str(TOP / "ros" / "src")))
def test_every_package_is_named(path):
    page = Page(TOP / "docs" / "organisation.md")
    cells = [cell for table in page.tables for row in table.rows for cell in row]
    # The stand-ins share a README.
    folder = re.sub(r"stand_ins/\w+", "stand_ins", path)
    assert any(f"/{folder}/README.md)" in cell for cell in cells)
    tree = page.blocks[0].text
    assert re.search(rf"^ +{path.rpartition('/')[2]}\b", tree, re.MULTILINE)


@pytest.mark.parametrize("folder", ["docs", "docs/course"])
def test_every_page_is_in_the_table_of_contents(folder):
    contents = LINK.findall((TOP / folder / "README.md").read_text())
    pages = {path.name for path in PAGES if path.parent == TOP / folder}
    assert pages - {"README.md"} <= set(contents)
