"""The terminal into which the tests type."""

import pytest
from terminal import CommandError, Terminal
from workspaces import clean_environment

LIMIT = 60.0


@pytest.fixture
def terminal(tmp_path):
    """Return a terminal in a folder of its own."""
    terminal = Terminal(tmp_path, clean_environment(tmp_path / "home"))
    yield terminal
    terminal.close()


def test_returns_what_is_printed(terminal):
    assert terminal.run("echo $((1 + 2))", LIMIT).endswith("\n3\r\n")


def test_commands_share_a_shell(terminal, tmp_path):
    terminal.run("mkdir below; cd below; word=here", LIMIT)
    assert f"here {tmp_path}/below\r\n" in terminal.run("echo $word $PWD", LIMIT)


def test_a_command_that_fails_is_noticed(terminal):
    with pytest.raises(CommandError, match="status 3\n(.*\n)*why"):
        terminal.run("echo why; (exit 3)", LIMIT)
    terminal.run("true", LIMIT)


def test_a_command_that_does_not_end_is_noticed(terminal):
    with pytest.raises(CommandError, match="not ended"):
        terminal.run("sleep 100", 0.2)


def test_a_command_goes_on_until_it_is_interrupted(terminal):
    terminal.start("bash -c 'echo it has $((0)) begun; sleep 100'")
    while "it has 0 begun" not in terminal.output:
        terminal.read(LIMIT)
    with pytest.raises(CommandError, match="goes on"):
        terminal.run("true", LIMIT)
    terminal.interrupt()
    terminal.run("true", LIMIT)


def test_a_shell_in_the_shell_gets_the_next_commands(terminal):
    terminal.run("bash --norc", LIMIT)
    assert "\r\n2\r\n" in terminal.run("echo $SHLVL", LIMIT)


def test_the_first_python_is_a_wrong_one(terminal):
    with pytest.raises(CommandError, match="wrong python3"):
        terminal.run("python3 --version", LIMIT)
