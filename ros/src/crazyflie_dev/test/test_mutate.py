"""Mutants are what they are said to be; a vacuous test leaves exactly its own alive."""

import json
import subprocess
import sys

import pytest

from crazyflie_dev.mutants import mutants

MODULE = """
import math

def well_tested(angle):
    '''Return 2 angles.'''
    if angle < 0:
        raise ValueError(f"angle {angle + 1}")
    return 2.0 * angle

class Range:
    @property
    def middle(self):
        return 5.0 - math.sin(0.0)

    def has(self, x) -> bool:
        return x < 3

def hangs(n):
    while n > 0:
        n -= 1
    return n

def untested(x=1):
    return -x
"""

TESTS = """
import pytest
from toy.numbers import Range, hangs, well_tested

def test_well():
    assert (well_tested(0), well_tested(1.0), well_tested(-0.0)) == (0.0, 2.0, 0.0)
    with pytest.raises(ValueError):
        well_tested(-1)

def test_vacuously():
    assert Range().middle or True
    assert Range().has(2)

def test_hangs():
    assert hangs(3) == 0
"""

SURVIVORS = {
    "numbers.py Range.middle: `5.0 - math.sin(0.0) -> 5.5 - math.sin(0.0)`",
    "numbers.py Range.middle: `5.0 - math.sin(0.0) -> 5.0 + math.sin(0.0)`",
    "numbers.py Range.middle: `math.sin(0.0) -> math.cos(0.0)`",
    "numbers.py Range.middle: `math.sin(0.0) -> math.sin(1.0)`",
    "numbers.py Range.has: `x < 3 -> x <= 3`",
    "numbers.py Range.has: `x < 3 -> x < 4`",
    "numbers.py untested: `-x -> x`",
}


@pytest.fixture
def toy(tmp_path):
    (tmp_path / "toy/src/toy").mkdir(parents=True)
    (tmp_path / "toy/test").mkdir()
    (tmp_path / "toy/src/toy/__init__.py").write_text("")
    (tmp_path / "toy/src/toy/numbers.py").write_text(MODULE)
    (tmp_path / "toy/src/toy/some_node.py").write_text("from crazyflie_utils import Node\n")
    (tmp_path / "toy/test/test_toy.py").write_text(TESTS)
    return tmp_path


def mutate(folder, *words):
    code = "import sys; sys.path.insert(0, 'toy/src'); from crazyflie_dev.mutate import main; "
    command = [sys.executable, "-c", code + "sys.exit(main())", "toy", *words]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=100.0)
    return run.returncode, run.stdout + run.stderr


def test_survivors_are_those_of_the_vacuous_test(toy):
    status, text = mutate(toy)
    assert status == 1, text
    results = json.loads((toy / "out/mutate/toy.json").read_text())
    assert {each["mutant"] for each in results["survivors"]} == SURVIVORS
    assert results["modules"]["toy"]["survived"] == len(SURVIVORS)
    assert "numbers.py:16 Range.has: `x < 3 -> x <= 3`" in text
    assert set(results["modules"]) == {"numbers.py", "toy"}
    lines = "".join(f"{each}: It is a toy.\n" for each in SURVIVORS)
    (toy / "toy/test/equivalent_mutants.txt").write_text("# Explained.\n" + lines)
    status, text = mutate(toy)
    assert (status, "100%" in text) == (0, True), text


def test_bad_input(toy):
    assert mutate(toy, "letters")[1].rstrip().endswith("no module letters in toy/src")
    (toy / "toy/test/equivalent_mutants.txt").write_text("numbers.py f: `a -> b`\n")
    status, text = mutate(toy)
    assert status == 2
    assert "numbers.py f: `a -> b`'; expected MODULE FUNCTION: `CHANGE`: REASON" in text


@pytest.mark.parametrize(
    "before, after",
    [
        ("a + b * c", {"a - b * c", "a + b / c"}),
        ("'a' + b", set()),
        ("a and not b", {"a or not b", "a and b"}),
        ("max(a, 0) >= 1", {"max(a, 0) > 1", "min(a, 0) >= 1", "max(a, 1) >= 1", "max(a, 0) >= 2"}),
        ("math.radians(a)", {"a"}),
        ("a if b is None else 1e-9", {"a if b is not None else 1e-9"}),
        ("f'{a + 1}'", set()),
        ("log.warn('a', b + 1)", set()),
        ("x[-2]", {"x[2]", "x[-3]"}),
        ("a != 2.0", {"a == 2.0", "a != 2.2"}),
    ],
)
def test_changes(tmp_path, before, after):
    path = tmp_path / "module.py"
    path.write_text(f"def f(a):\n    return {before}\n")
    results = {}
    for mutant in mutants(path):
        results[mutant.after] = mutant.code().co_code, mutant.code().co_consts
    expected = set()
    for text in after:
        code = compile(f"def f(a):\n    return {text}\n", str(path), "exec").co_consts[0]
        expected.add((code.co_code, code.co_consts))
    assert set(results.values()) == expected


def test_refusals_are_dropped(tmp_path):
    path = tmp_path / "module.py"
    code = "def f(a) -> bool:\n    if a is b:\n        return c\n    if a:\n        raise E('t')\n"
    path.write_text(code)
    found = [(mutant.line, mutant.before, mutant.after) for mutant in mutants(path)]
    assert found == [
        (2, "a is b", "False"),
        (2, "a is b", "a is not b"),
        (3, "return c", "return not c"),
        (5, "raise E", "pass"),
    ]
