"""Findings of a check."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

OK, WARN, ERROR = "ok", "warn", "error"


@dataclass(frozen=True)
class Finding:
    """A fault and its remedy."""

    level: str  #: `WARN`, or `ERROR` for what keeps a vehicle from flying as it should.
    text: str
    remedy: str


@dataclass(frozen=True)
class Check:
    """A check of one thing."""

    name: str
    fine: str  #: Text for a check without findings.
    findings: Iterable[Finding]  #: Often a generator, which makes the check when it is iterated.


def warn(text: str, remedy: str) -> Finding:
    """Return a finding that should be looked at."""
    return Finding(WARN, text, remedy)


def error(text: str, remedy: str) -> Finding:
    """Return a finding that keeps a vehicle from flying as it should."""
    return Finding(ERROR, text, remedy)


def lines(check: Check) -> Iterator[tuple[str, str]]:
    """Make a check; yield level and line of each finding, or of its being fine."""
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
