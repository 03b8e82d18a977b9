"""Count the tests of a workspace; the last line is "N passed, N failed".

python3 -m crazyflie_dev.count_results build/test_results
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

_ROSTEST = "rostest.runner.RosTest"
"""Class name under which rostest notes that a test node ran. The tests of that node
are in a file of their own, rosunit-NAME.xml, beside rostest's."""


@dataclass(frozen=True)
class Outcome:
    """What became of a test.

    Attributes
    ----------
    file : Path
        Of the results, below the folder of all results.
    name : str
    verdict : str
        "passed", "failed" or "skipped".
    reason : str
        First line of what a failed test said.
    """

    file: Path
    name: str
    verdict: str
    reason: str = ""


def read_results(folder: Path) -> list[Outcome]:
    """Return the outcome of every test in the JUnit XML files below a folder.

    A file that cannot be read or has no test in it counts as a failed test: its
    program has died before it could tell.
    """
    outcomes = []
    for path in sorted(folder.rglob("*.xml")):
        file = path.relative_to(folder)
        try:
            cases = list(ElementTree.parse(path).getroot().iter("testcase"))
        except ElementTree.ParseError as error:
            outcomes.append(Outcome(file, path.stem, "failed", f"no XML: {error}"))
            continue
        if not cases:
            outcomes.append(Outcome(file, path.stem, "failed", "no test ran"))
        for case in cases:
            outcomes.extend(_outcomes(path, file, case))
    return outcomes


def _outcomes(path, file, case):
    classname, name = case.get("classname", ""), case.get("name", "")
    full_name = f"{classname}.{name}" if classname else name
    for complaint in (*case.iter("failure"), *case.iter("error")):
        text = complaint.get("message") or complaint.text or ""
        return [Outcome(file, full_name, "failed", text.strip().partition("\n")[0])]
    if case.find("skipped") is not None:
        return [Outcome(file, full_name, "skipped")]
    if classname != _ROSTEST:
        return [Outcome(file, full_name, "passed")]
    results = path.with_name(f"rosunit-{name.removeprefix('test')}.xml")
    if results.exists():
        return []
    return [Outcome(file, full_name, "failed", f"there is no {results.name}")]


def summary(outcomes: list[Outcome]) -> str:
    """Return "N passed, N failed", and how many were skipped if any were."""
    verdicts = [outcome.verdict for outcome in outcomes]
    words = ["passed", "failed"] + ["skipped"] * ("skipped" in verdicts)
    return ", ".join(f"{verdicts.count(word)} {word}" for word in words)


def main() -> int:
    """Print failed tests and sums; return 1 if any failed or none ran."""
    parser = argparse.ArgumentParser(description="Count the tests below a folder of results.")
    parser.add_argument("folder", type=Path)
    outcomes = read_results(parser.parse_args().folder)
    for outcome in outcomes:
        if outcome.verdict == "failed":
            print(f"FAILED {outcome.file}: {outcome.name}: {outcome.reason}")
    print(summary(outcomes))
    verdicts = {outcome.verdict for outcome in outcomes}
    return 0 if "passed" in verdicts and "failed" not in verdicts else 1


if __name__ == "__main__":
    sys.exit(main())
