"""Comparison of a command's output with the output on a page of the manual."""

from pathlib import Path

import pytest
from pages import Page
from reader import Reader, is_printed
from workspaces import TOP

OUTPUT = "first\r\n\x1b[1msecond: 3.25 \x1b[0m\r\n  third\r\n\r\nfourth\r\n"


@pytest.mark.parametrize(
    "excerpt",
    ["first", "second: 3.25\n  third", "sec...25\n  third", "first\n...\n\nfourth", "...\nfirst"],
)
def test_what_is_printed(excerpt):
    assert is_printed(excerpt, OUTPUT)


@pytest.mark.parametrize(
    "excerpt",
    [
        "second: 3.26",
        "second: 3.2",
        "first\n  third",
        "third\n",
        "econd: 3.25",
        "fourth\n...\nfirst",
    ],
)
def test_what_is_not_printed(excerpt):
    assert not is_printed(excerpt, OUTPUT)


def test_a_progress_bar_is_overwritten():
    output = "  3% of it\r 90% of it\r           \rdone\r\n100%\r\r\nend\r\n"
    assert is_printed("done\n100%\nend", output)
    assert not is_printed("90% of it\n...", output)


PAGE = """
<!-- run -->
```sh
echo $((6 * 7)) is the answer
```

<!-- prints -->
```text
ANSWER
```

<!-- run: until it prints 42 -->
```sh
bash -c 'echo $((6 * 7)); exec sleep 1000'
```
"""


@pytest.fixture
def follow(tmp_path):
    """Return a function that has a reader follow a page."""
    reader = Reader(TOP, tmp_path / "home")

    def follow_text(text):
        page: Path = tmp_path / "page.md"
        page.write_text(text)
        reader.follow(Page(page))

    yield follow_text
    reader.close()


def test_a_page_that_says_what_is_printed_is_followed(follow):
    follow(PAGE.replace("ANSWER", "42 is ..."))


def test_a_page_that_says_something_else_is_not(follow):
    with pytest.raises(AssertionError, match="42 is the answer"):
        follow(PAGE.replace("ANSWER", "43 is ..."))
