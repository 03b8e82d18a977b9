"""Run the tests of the built workspace with ctest; repeat failed ones alone.

python3 -m crazyflie_dev.run_tests ros/build [--all]

A test that fails among others and passes three times alone is flaky: it does not count as passed.
With ``--all`` it fails the run, without, it is named only: a flight in real time may lack the
processor on a shared machine, and who changes something else is not to wait for its cause. What
ctest has printed and the files of results in ``test_results`` are those of the first run; the
repetitions write theirs below ``test_repeats``.
"""

import argparse
import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from crazyflie_dev.count_results import Case, cases, results_of_nodes, summarize

LONG = "long"  #: Label of ctest and marker of pytest for the tests that ``--all`` adds.
REPEATS = 3  #: Number of passes alone after which a failed test is flaky.
MOST_REPEATED = 10  #: If more tests have failed, something is broken, and none is repeated.
LIMIT = 900  #: Longest time of one repetition (s).


@dataclass(frozen=True)
class Program:
    """A test of ctest: catkin's run_tests.py, the file of results, and a line for the shell."""

    name: str
    command: tuple[str, ...]
    folder: str

    @property
    def reports(self) -> Iterator[Path]:
        """Its files of results: its own and, of a rostest, those of the test nodes."""
        report = Path(self.command[3])
        if not report.exists():
            # Text by which catkin reports that a program has died without results.
            report = report.with_name(f"MISSING-{report.name}")
        yield report
        yield from results_of_nodes(report)

    def only(self, case: Case) -> "Program":
        """Return the program that runs this test only.

        The tests of a rostest build on one another, so its whole launch is repeated.
        """
        words = shlex.split(self.command[-1])
        if "pytest" not in words or not case.name:
            return self
        path = words[words.index("pytest") + 1]
        words[words.index(path)] = _node_id(Path(path), case)
        return replace(self, command=(*self.command[:-1], shlex.join(words)))

    def passes(self, results: Path, repeats: Path) -> bool:
        """Run it, its results in another folder; tell whether it passes."""
        command = [word.replace(str(results), str(repeats)) for word in self.command]
        limited = ["timeout", str(LIMIT), *command]
        return subprocess.run(limited, cwd=self.folder, check=False).returncode == 0


def _node_id(path: Path, case: Case) -> str:
    folder = path if path.is_dir() else path.parent
    parts = case.classname.split(".")
    for k, part in enumerate(parts):
        module = folder / f"{part}.py"
        if module.exists():
            return "::".join([str(module), *parts[k + 1 :], case.name])
    return str(path)


def programs(build: Path) -> list[Program]:
    """Return the tests that ctest knows."""
    shown = subprocess.run(
        ["ctest", "--test-dir", str(build), "--show-only=json-v1"],
        check=True,
        capture_output=True,
        text=True,
    )
    return [
        Program(
            test["name"],
            tuple(test["command"]),
            next(p["value"] for p in test["properties"] if p["name"] == "WORKING_DIRECTORY"),
        )
        for test in json.loads(shown.stdout)["tests"]
    ]


def run_ctest(build: Path, everything: bool) -> set[str]:
    """Run the tests, up to two for each processor at a time; return the names of the failed.

    Most of them mostly wait.
    """
    failed = build / "Testing" / "Temporary" / "LastTestsFailed.log"
    failed.unlink(missing_ok=True)
    command = ["ctest", "--test-dir", str(build), "--timeout", "3600", "--output-on-failure"]
    command += ["-j", str(2 * (os.cpu_count() or 1))]
    # Several tests share the processors; NumPy's threads would only wait for one another.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("PYTEST_ADDOPTS", None)
    if not everything:
        command += ["-LE", LONG]
        environment["PYTEST_ADDOPTS"] = f"-m 'not {LONG}'"
    status = subprocess.run(command, env=environment, check=False).returncode
    if not failed.exists():
        return set() if status == 0 else {"ctest"}
    return {line.partition(":")[2] for line in failed.read_text().splitlines()}


def judge(program: Program, build: Path, repeat: bool) -> Iterator[Case]:
    """Yield the tests of a failed program; those that pass alone are flaky."""
    results = [case for report in program.reports for case in cases(report)]
    if not any(case.verdict == "failed" for case in results):
        report = Path(program.command[3])
        results.append(Case(report, "", "", "failed", "the program has failed"))
    alone: dict[Program, bool] = {}
    for case in results:
        if case.verdict != "failed":
            yield case
            continue
        only = program.only(case)
        if only not in alone:
            alone[only] = repeat and _passes_alone(only, build, case)
        yield replace(case, verdict="flaky") if alone[only] else case


def _passes_alone(program: Program, build: Path, case: Case) -> bool:
    results, repeats = build / "test_results", build / "test_repeats"
    label = case.label(results)
    print(f"== repeating by itself: {label}", flush=True)
    return all(program.passes(results, repeats / str(k + 1)) for k in range(REPEATS))


def main() -> int:
    """Run the tests and print the summary; return 0 if all have passed."""
    parser = argparse.ArgumentParser(prog="./run tests", description="Run the tests.")
    parser.add_argument("build", type=Path, help=argparse.SUPPRESS)
    parser.add_argument(
        "--all",
        action="store_true",
        dest="everything",
        help="also those that take long, and other examples of hypothesis in each run",
    )
    arguments = parser.parse_args()
    if arguments.everything:
        os.environ["HYPOTHESIS_PROFILE"] = "nightly"
    build = arguments.build.resolve()
    for folder in ("test_results", "test_repeats"):
        shutil.rmtree(build / folder, ignore_errors=True)
    names = run_ctest(build, arguments.everything)
    failed = [program for program in programs(build) if program.name in names]
    judged = [report for program in failed for report in program.reports]
    reports = [p for p in sorted((build / "test_results").rglob("*.xml")) if p not in judged]
    results = [case for report in reports for case in cases(report)]
    count = sum(case.verdict == "failed" for report in judged for case in cases(report))
    for program in failed:
        results += judge(program, build, repeat=count <= MOST_REPEATED)
    passed = summarize(build / "test_results", results, arguments.everything)
    # ctest itself may have failed.
    return 0 if passed and len(failed) == len(names) else 1


if __name__ == "__main__":
    sys.exit(main())
