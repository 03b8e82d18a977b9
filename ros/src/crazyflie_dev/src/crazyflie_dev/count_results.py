"""Count the tests of a workspace; the last line is "N passed, N failed".

python3 -m crazyflie_dev.count_results build/test_results
"""

import argparse
import contextlib
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

#: Class name under which rostest notes that a test node ran. The tests of that node are in a
#: separate file, rosunit-NAME.xml, next to rostest's.
_ROSTEST = "rostest.runner.RosTest"


@dataclass(frozen=True)
class Case:
    """One test in a file of results."""

    report: Path  #: The file.
    #: classname, name: As in the file; empty for a file without a test.
    classname: str
    name: str
    verdict: str  #: "passed", "failed", "skipped" or "flaky".
    reason: str = ""  #: First line of the failure.

    def label(self, folder: Path) -> str:
        """Return the file of results, relative to a folder, and the name of the test."""
        names = ".".join(part for part in (self.classname, self.name) if part)
        return f"{self.report.relative_to(folder)}: {names}".removesuffix(": ")


def cases(path: Path) -> Iterator[Case]:
    """Yield the tests in a JUnit XML file.

    A file that cannot be read or has no test in it is a failed test: its program
    has died before it wrote its results.
    """
    try:
        elements = list(ElementTree.parse(path).getroot().iter("testcase"))
    except (ElementTree.ParseError, OSError) as error:
        yield Case(path, "", "", "failed", f"not XML: {error}")
        return
    if not elements:
        yield Case(path, "", "", "failed", "no test ran")
    for element in elements:
        case = Case(path, element.get("classname", ""), element.get("name", ""), "passed")
        complaint = next((e for e in element if e.tag in ("failure", "error")), None)
        if complaint is not None:
            text = complaint.get("message") or complaint.text or ""
            yield replace(case, verdict="failed", reason=text.strip().partition("\n")[0])
        elif element.find("skipped") is not None:
            yield replace(case, verdict="skipped")
        elif case.classname != _ROSTEST:
            yield case
        elif not (results := _results_of_node(path, case.name)).exists():
            yield replace(case, verdict="failed", reason=f"there is no {results.name}")


def results_of_nodes(report: Path) -> Iterator[Path]:
    """Yield the files of results that the test nodes of a rostest have left, from rostest's own."""
    # `cases` reports an unreadable file as a failed test.
    with contextlib.suppress(ElementTree.ParseError, OSError):
        for element in ElementTree.parse(report).getroot().iter("testcase"):
            if element.get("classname") == _ROSTEST:
                results = _results_of_node(report, element.get("name", ""))
                if results.exists():
                    yield results


def _results_of_node(report, name):
    return report.with_name(f"rosunit-{name.removeprefix('test')}.xml")


def summarize(folder: Path, results: Iterable[Case], is_strict: bool = True) -> bool:
    """Print failed and flaky tests and the sums; return whether some passed and none failed.

    If it is strict, a flaky test has failed.
    """
    results = list(results)
    for case in results:
        if case.verdict == "failed":
            label = case.label(folder)
            print(f"FAILED {label}: {case.reason}")
    count = Counter(case.verdict for case in results)
    words = ["passed", "failed", *(word for word in ("flaky", "skipped") if word in count)]
    print(", ".join(f"{count[word]} {word}" for word in words))
    for case in results:
        if case.verdict == "flaky":
            print(f"FLAKY: {case.label(folder)}")
    return count["passed"] > 0 and not count["failed"] and not (is_strict and count["flaky"])


def main() -> int:
    """Print failed tests and sums; return 1 if any failed or none ran."""
    parser = argparse.ArgumentParser(description="Count the tests below a folder of results.")
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    reports = sorted(folder.rglob("*.xml"))
    return 0 if summarize(folder, [case for path in reports for case in cases(path)]) else 1


if __name__ == "__main__":
    sys.exit(main())
