"""The exceptions by which a command is refused, with the reason; refusals of several vehicles."""

import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence

_MAX_NAMES = 8  #: Largest number of names in one text.


class RefusalError(Exception):
    """A command is not possible now; the text says why. Nothing has changed.

    If the callback of a service raises it, the text is the service's error.
    """


class ServiceError(Exception):
    """A service refused or failed; the text is the reason, for the caller."""


def distinct(value: float, limit: float, form: str = "f", digits: int = 2) -> tuple[str, str]:
    """Return two different numbers as texts that differ, with more digits if they need them.

    ``form`` is that of a format: "f" for decimal places, "g" for significant digits.
    """
    shown, least = (f"{number:.{digits}{form}}" for number in (value, limit))
    if shown == least and value != limit and digits < 9:
        return distinct(value, limit, form, digits + 1)
    return shown, least


def listed(names: Sequence[str], what: str = "vehicles") -> str:
    """Return names as a text; of many only their number and what they are."""
    return ", ".join(names) if len(names) <= _MAX_NAMES else f"{len(names)} {what}"


def by_reason(refusals: Mapping[str, str], listed: Callable[..., str] = ", ".join) -> list[str]:
    """Return refusals (vehicle to reason) as texts: each reason once, after its vehicles.

    Reasons that differ in numbers only are one, with the numbers of the first vehicle.
    """
    names = defaultdict(list)
    for name, reason in refusals.items():
        names[re.sub(r"\d+(\.\d+)?", "#", reason)].append(name)
    texts = []
    for each in names.values():
        differ = len({refusals[name] for name in each}) > 1
        of = f" (numbers of {each[0]})" if differ else ""
        texts.append(f"{listed(each)}: {refusals[each[0]]}{of}")
    return texts


def refusals_text(refusals: Mapping[str, str], count: int) -> str:
    """Return the refusals (vehicle to reason) of some of ``count`` vehicles as one text."""
    texts = "; ".join(by_reason(dict(sorted(refusals.items()))))
    return f"{len(refusals)} of {count} vehicles: {texts}"
