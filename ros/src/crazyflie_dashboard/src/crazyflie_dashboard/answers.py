"""Work that waits for answers of services; their texts."""

import contextlib
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from crazyflie_dashboard.page_data import Outcome
from crazyflie_utils import ServiceError
from crazyflie_utils.steps import Steps

_MAX_NAMES = 8  #: Largest number of vehicle names in one text.


def words(error: BaseException) -> str:
    """Return the text of an answer; `NodeHandle.call_service` has removed rospy's words."""
    return str(error) or repr(error)


def any_of(answers: "list[Future[Any]]") -> "Future[Any]":
    """Return the first answer that is not a refusal; otherwise the refusals."""
    outcome: Future[Any] = Future()
    texts: list[str] = []

    def note(done):
        error = done.exception()
        if error is not None:
            texts.append(words(error))
        with contextlib.suppress(Exception):
            if error is None:
                outcome.set_result(done.result())
            elif len(texts) == len(answers):
                outcome.set_exception(ServiceError("; ".join(texts)))

    for answer in answers:
        answer.add_done_callback(note)
    return outcome


def gathered(answers: "Mapping[str, Future[Any]]") -> Steps[tuple[Outcome, ...]]:
    """Return the outcomes of all vehicles, when the last one has answered."""
    texts = dict.fromkeys(answers, "")
    for name, answer in answers.items():
        try:
            yield answer
        except Exception as error:
            texts[name] = words(error)
    return tuple(Outcome(name, text) for name, text in texts.items())


def summary(outcomes: Iterable[Outcome]) -> list[str]:
    """Return the refusals, each text once with its vehicles."""
    names: dict[str, list[str]] = {}
    for each in outcomes:
        if each.text:
            names.setdefault(each.text, []).append(each.vehicle)
    return [f"{listed(each)}: {text}" for text, each in names.items()]


def listed(names: Sequence[str]) -> str:
    """Return names as a text; for many vehicles only their number."""
    return ", ".join(names) if len(names) <= _MAX_NAMES else f"{len(names)} vehicles"
