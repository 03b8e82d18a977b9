"""Measures what unit tests catch: changes the algorithms of a package, one place at a time.

``python3 -m crazyflie_dev.mutate PACKAGE [MODULE ...]`` collects the unit tests once, notes which
functions each of them calls, and then, for each mutant, runs those that call the changed function
in a fork of the process. There the code of the loaded function is replaced, so nothing is imported
anew. Modules are by default those without ROS, see `uses_ros`; tests are those that are quick, see
`mutant_tests.BUDGET`, and start no program.

A mutant is caught if a test fails, dies, or takes far longer than usual. One that changes nothing
is explained in the package's test/equivalent_mutants.txt: a line with its text from the output,
but the number of the line, then a colon and the reason.
"""

import argparse
import ast
import gc
import importlib
import json
import random
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest
import rospkg
from hypothesis import Phase, settings
from tqdm import tqdm

from crazyflie_dev.mutant_tests import (
    CallRecorder,
    Test,
    first_failure,
    forked,
    measured,
    within_budget,
)
from crazyflie_dev.mutants import Mutant, mutants
from crazyflie_utils.testing import pytest_plugin

GOAL = 0.9  #: Share of mutants that are to be caught, without those explained.
EXPLAINED = "equivalent_mutants.txt"  #: In the folder of the tests.


_EXPLANATION = re.compile(r"(\S+ \S+: `[^`]+`): (.*\S.*)")

#: A mutant and the test that caught it: its node id, DIED, or "" for none.
Result = tuple[Mutant, str]
DIED = "a test that died or hung"


class MutationPlugin:
    """Of pytest: imports modules, and runs mutants of them in place of the tests.

    Parameters
    ----------
    modules : iterable of str
        Their full names.
    sample : int or None
        How many mutants are drawn at random; None for all.
    seed : int
        Of the drawing.
    """

    def __init__(self, modules: Iterable[str], sample: int | None, seed: int):
        self.results: list[Result] = []
        self._modules = modules
        self._sample = sample
        self._seed = seed
        self._paths: list[str] = []
        self._imports = CallRecorder()

    @pytest.hookimpl(hookwrapper=True)
    def pytest_collection(self) -> Iterator[None]:
        """Import the modules and those of the tests, and note what they call."""
        with self._imports:
            modules = [importlib.import_module(name) for name in self._modules]
            self._paths = [str(module.__file__) for module in modules]
            yield

    def pytest_runtestloop(self, session: pytest.Session) -> bool | None:
        """Run the mutants, unless a test module could not be imported."""
        if session.testsfailed:
            return None
        tests, others = measured(session.items, set(self._paths))
        for other in others:
            print(f"left out: {other}")
        self._run(self._draw(tests), tests)
        return True

    def _draw(self, tests: list[Test]) -> list[Mutant]:
        """Return the mutants of functions but of those that are called by imports only."""
        past = self._imports.functions(set(self._paths))
        past = past.difference(*(test.functions for test in tests))
        found = [each for path in self._paths for each in mutants(Path(path))]
        found = [each for each in found if (str(each.path), each.function) not in past]
        if self._sample is None or len(found) <= self._sample:
            return found
        chosen = random.Random(self._seed).sample(range(len(found)), self._sample)
        return [found[index] for index in sorted(chosen)]

    def _run(self, found: list[Mutant], tests: list[Test]) -> None:
        loaded = loaded_functions(set(self._paths))
        catches: Counter[tuple[str, str]] = Counter()
        for mutant in tqdm(found, desc="mutants", mininterval=2.0, smoothing=0.0):
            code = mutant.code()
            functions = loaded[str(mutant.path), mutant.function, mutant.first_line]
            if any(f.__code__.co_freevars != code.co_freevars for f in functions):
                continue  # Python does not accept it.
            key = str(mutant.path), mutant.function
            callers = [test for test in tests if key in test.functions]
            # What has caught a neighbour often catches this one, too.
            callers.sort(key=lambda t: (-catches[mutant.function, t.item.nodeid], t.duration))
            failed = forked(partial(first_failure, functions, code, within_budget(callers)))
            failed = DIED if failed is None else failed
            catches[mutant.function, failed] += 1
            self.results.append((mutant, failed))


def loaded_functions(paths: set[str]) -> dict[tuple[str, str, int], list[FunctionType]]:
    """Return the functions of modules by path, qualified name and first line of their code."""
    found = defaultdict(list)
    for each in gc.get_objects():
        if isinstance(each, FunctionType) and each.__code__.co_filename in paths:
            code = each.__code__
            found[code.co_filename, code.co_qualname, code.co_firstlineno].append(each)
    return found


def uses_ros(path: Path) -> bool:
    """Return whether a module imports rospy, messages, services, Node or NodeHandle."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names = {each.name for each in node.names} | {getattr(node, "module", None) or ""}
            is_message = any(name.endswith((".msg", ".srv")) for name in names)
            if is_message or names & {"rospy", "Node", "NodeHandle"}:
                return True
    return False


def chosen_modules(package: Path, names: list[str]) -> list[str]:
    """Return full names of modules of a package: those named, else those without ROS."""
    sources = package / "src"
    paths = sorted(
        path
        for path in sources.rglob("*.py")
        if path.name != "__init__.py" and "testing" not in path.parts
    )
    if names:
        stems = {name.removesuffix(".py") for name in names}
        if unknown := stems - {path.stem for path in paths}:
            raise ValueError(f"no module {', '.join(sorted(unknown))} in {sources}")
        paths = [path for path in paths if path.stem in stems]
    else:
        paths = [path for path in paths if not uses_ros(path)]
    return [".".join(path.relative_to(sources).with_suffix("").parts) for path in paths]


def explanations(package: Path) -> dict[str, str]:
    """Return the mutants explained beside the tests, each with its reason.

    Raises
    ------
    ValueError
        If a line has no reason.
    """
    found = {}
    path = package / "test" / EXPLAINED
    for line in path.read_text().splitlines() if path.exists() else []:
        if line and not line.startswith("#"):
            if not (match := _EXPLANATION.fullmatch(line)):
                raise ValueError(f"{path}: '{line}'; expected MODULE FUNCTION: `CHANGE`: REASON")
            found[match[1]] = match[2]
    return found


def report(package: str, results: list[Result], explained: dict[str, str]) -> dict[str, Any]:
    """Print survivors, and what was caught of each module; return the same for a file."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    survivors, alive = [], {str(mutant) for mutant, test in results if not test}
    for mutant, test in results:
        is_explained = str(mutant) in explained
        fate = "caught" if test else "explained" if is_explained else "survived"
        counts[mutant.path.name][fate] += 1
        if fate == "survived":
            print(f"{mutant.path.name}:{mutant.line} {str(mutant).partition(' ')[2]}")
            survivors.append({"file": str(mutant.path), "line": mutant.line, "mutant": str(mutant)})
        elif is_explained and str(mutant) not in alive:
            print(f"explained, but caught by {test}: {mutant}")
    counts[package] = sum(counts.values(), Counter())
    for name, count in counts.items():
        note = f", {count['explained']} explained" if count["explained"] else ""
        print(f"{name:<32} {count['caught']:>4} of {count.total():<4} {share(count):>4.0%}{note}")
    modules = {name: {**count, "share": share(count)} for name, count in counts.items()}
    return {"modules": modules, "survivors": survivors}


def share(count: Counter[str]) -> float:
    """Return the share of mutants caught, those explained left out; 1 if there are none."""
    judged = count["caught"] + count["survived"]
    return count["caught"] / judged if judged else 1.0


def main() -> int:
    """Run the mutants of a package; return 0 if enough are caught."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("package", help="name or folder of a package")
    parser.add_argument("modules", nargs="*", help="such as angles; default: those without ROS")
    parser.add_argument("--sample", type=int, help="how many mutants, drawn at random")
    parser.add_argument("--seed", type=int, default=0, help="of the drawing")
    arguments = parser.parse_args()
    try:
        folder = Path(arguments.package)
        if not folder.is_dir():
            folder = Path(rospkg.RosPack().get_path(arguments.package))
        plugin = MutationPlugin(
            chosen_modules(folder, arguments.modules), arguments.sample, arguments.seed
        )
        explained = explanations(folder)
    except (rospkg.ResourceNotFound, ValueError) as error:
        parser.error(str(error))
    settings.register_profile(
        "mutate",
        settings.get_profile("workspace"),
        phases=[Phase.explicit, Phase.generate],  # No shrinking of what has failed.
    )
    settings.load_profile("mutate")
    options = ["-qq", "-s", "-m", "not long", "-p", "no:cacheprovider"]
    pytest.main([*options, str(folder / "test")], [pytest_plugin, plugin])
    if not plugin.results:
        print("no mutant was run")
        return 1
    name = folder.resolve().name
    result = report(name, plugin.results, explained)
    path = Path("out/mutate") / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result, indent=1))
    print(f"results: {path}")
    return 0 if result["modules"][name]["share"] >= GOAL else 1


if __name__ == "__main__":
    sys.exit(main())
