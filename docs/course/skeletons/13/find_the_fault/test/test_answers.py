"""Whether the answers are right; it knows them only by their digests."""

from hashlib import sha256
from pathlib import Path

import pytest
import yaml

ANSWERS = Path(__file__).resolve().parents[1] / "answers.yaml"
FAULTS = {"heavy", "light", "headwind", "crosswind", "noise", "gaps"}


@pytest.mark.parametrize(
    ("recording", "digest"),
    [("a", "1af54af1a6a8f7a4"), ("b", "7db66ffce86d49d3"), ("c", "95581850cd6ccb5e")],
)
def test_the_fault_is_found(recording, digest):
    answer = yaml.safe_load(ANSWERS.read_text())[recording]
    assert answer in FAULTS, f"{answer!r}; expected one of {', '.join(sorted(FAULTS))}"
    found = sha256(f"{recording}: {answer}".encode()).hexdigest()
    assert found.startswith(digest), f"recording {recording} has another fault than {answer}"
