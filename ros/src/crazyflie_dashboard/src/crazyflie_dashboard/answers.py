"""Work that waits for answers of services; their texts."""

import contextlib
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from typing import Any

from crazyflie_dashboard.page_data import Outcomes
from crazyflie_utils import ServiceError
from crazyflie_utils.refusal import by_reason
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


def gathered(answers: "Mapping[str, Future[Any]]") -> Steps[Outcomes]:
    """Return the outcomes of all vehicles, when the last one has answered."""
    texts = dict.fromkeys(answers, "")
    for name, answer in answers.items():
        try:
            yield answer
        except Exception as error:
            texts[name] = words(error)
    return texts


def summary(outcomes: Outcomes) -> list[str]:
    """Return the refusals, each text once with its vehicles."""
    return by_reason({name: text for name, text in outcomes.items() if text}, listed)


def listed(names: Sequence[str]) -> str:
    """Return names as a text; for many vehicles only their number."""
    return ", ".join(names) if len(names) <= _MAX_NAMES else f"{len(names)} vehicles"
