"""Work in steps, which waits for futures: as a generator that yields them."""

from collections.abc import Callable, Generator
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar

Result = TypeVar("Result")

#: A generator that yields a future where it waits for one, and returns its result.
Steps = Generator[Future[Any], Any, Result]


def follow(steps: Steps[Result], submit: Callable[..., None] | None = None) -> "Future[Result]":
    """Do steps; return the future of their result. The error of a future is raised in the steps.

    Each step but the first is done by ``submit(function, argument)``; by default in the thread that
    completes the future.
    """
    outcome: Future[Result] = Future()

    def go_on(done):
        # A loop: thousands of futures may be done already.
        while True:
            try:
                error = done and done.exception()
                awaited = steps.throw(error) if error else steps.send(done and done.result())
            except StopIteration as end:
                outcome.set_result(end.value)
                return
            except Exception as error:
                outcome.set_exception(error)
                return
            if submit is not None or not awaited.done():
                break
            done = awaited
        awaited.add_done_callback(partial(submit, go_on) if submit else go_on)

    go_on(None)
    return outcome


def copy_outcome(done: Future[Any], to: Future[Any]) -> None:
    """Complete a future with the outcome of another, unless it is done or cancelled."""
    if not done.cancelled():
        # The other one may be completed by another thread at any moment.
        with suppress(InvalidStateError):
            if error := done.exception():
                to.set_exception(error)
            else:
                to.set_result(done.result())
