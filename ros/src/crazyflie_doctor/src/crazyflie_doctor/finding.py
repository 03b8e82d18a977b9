"""Findings of a check."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial

OK, WARN, ERROR = "ok", "warn", "error"


@dataclass(frozen=True)
class Finding:
    """A fault and its remedy."""

    level: str  #: `WARN`, or `ERROR` for a fault that keeps a vehicle from flying correctly.
    text: str
    remedy: str


#: Findings that should be looked at, and those that keep a vehicle from flying correctly.
warn, error = partial(Finding, WARN), partial(Finding, ERROR)


@dataclass(frozen=True)
class Check:
    """A check of one thing."""

    name: str
    fine: str  #: Text for a check without findings.
    findings: Iterable[Finding]  #: Often a generator, which runs the check when it is iterated.


def lines(check: Check) -> Iterator[tuple[str, str]]:
    """Run a check; yield level and line of each finding, or one line that says that all is well."""
    findings = list(check.findings)
    if not findings:
        yield OK, f"ok     {check.name}: {check.fine}"
    for finding in findings:
        yield finding.level, f"{finding.level:5}  {check.name}: {finding.text}; {finding.remedy}"


def listed(names: Iterable[object], most: int = 5) -> str:
    """Return names in order, separated by commas; only the first of very many."""
    texts = sorted(map(str, names))
    more = [f"and {len(texts) - most} more"] if len(texts) > most else []
    return ", ".join(texts[:most] + more)
