"""Futures of commands."""

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any


def done(error: Exception | None) -> "Future[Any]":
    """Return a future that is done: with the result None, or an error."""
    future: Future[Any] = Future()
    if error is None:
        future.set_result(None)
    else:
        future.set_exception(error)
    return future


def forward(source: "Future[Any]", target: "Future[Any]") -> None:
    """Complete a future as another one."""

    def complete(answer):
        if (error := answer.exception()) is not None:
            target.set_exception(error)
        else:
            target.set_result(answer.result())

    source.add_done_callback(complete)


def in_turn(*calls: Callable[[], "Future[Any]"]) -> "Future[Any]":
    """Make calls one after the other; return the future of the last one, or of one that fails."""
    outcome: Future[Any] = Future()

    def go_on(answer, left):
        if answer.exception() is not None:
            outcome.set_exception(answer.exception())
        elif not left:
            outcome.set_result(answer.result())
        else:
            left[0]().add_done_callback(lambda next_one: go_on(next_one, left[1:]))

    calls[0]().add_done_callback(lambda first: go_on(first, calls[1:]))
    return outcome
