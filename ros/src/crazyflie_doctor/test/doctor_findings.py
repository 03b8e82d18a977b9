"""Findings of the doctor's checks, for their tests."""


def found(findings):
    """Return level and text of all findings; each says what to do."""
    findings = list(findings)
    assert all(finding.remedy for finding in findings)
    return [(finding.level, finding.text) for finding in findings]


def the_only(findings):
    [(level, text)] = found(findings)
    return level, text
