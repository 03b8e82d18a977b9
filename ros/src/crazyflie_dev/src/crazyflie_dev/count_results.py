"""Count the tests of a workspace; the last line is "N passed, N failed".

python3 -m crazyflie_dev.count_results build/test_results
"""

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

#: Class name under which rostest notes that a test node ran. The tests of that node are in a file
#: of their own, rosunit-NAME.xml, beside rostest's.
_ROSTEST = "rostest.runner.RosTest"


def verdicts(path: Path) -> Iterator[tuple[str, str]]:
    """Yield "passed", "failed" or "skipped" for each test in a JUnit XML file, and its reason.

    A file that cannot be read or has no test in it is a failed test: its program
    has died before it wrote its results.
    """
    try:
        cases = list(ElementTree.parse(path).getroot().iter("testcase"))
    except ElementTree.ParseError as error:
        yield "failed", f"no XML: {error}"
        return
    if not cases:
        yield "failed", "no test ran"
    for case in cases:
        classname, name = case.get("classname", ""), case.get("name", "")
        results = f"rosunit-{name.removeprefix('test')}.xml"
        complaint = next((e for e in case if e.tag in ("failure", "error")), None)
        if complaint is not None:
            text = complaint.get("message") or complaint.text or ""
            yield "failed", f"{classname}.{name}: {text.strip().partition(chr(10))[0]}"
        elif case.find("skipped") is not None:
            yield "skipped", ""
        elif classname != _ROSTEST:
            yield "passed", ""
        elif not path.with_name(results).exists():
            yield "failed", f"{classname}.{name}: there is no {results}"


def main() -> int:
    """Print failed tests and sums; return 1 if any failed or none ran."""
    parser = argparse.ArgumentParser(description="Count the tests below a folder of results.")
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    count: Counter[str] = Counter()
    for path in sorted(folder.rglob("*.xml")):
        for verdict, reason in verdicts(path):
            count[verdict] += 1
            if verdict == "failed":
                print(f"FAILED {path.relative_to(folder)}: {reason}")
    words = ["passed", "failed"] + ["skipped"] * ("skipped" in count)
    print(", ".join(f"{count[word]} {word}" for word in words))
    return 0 if count["passed"] and not count["failed"] else 1


if __name__ == "__main__":
    sys.exit(main())
