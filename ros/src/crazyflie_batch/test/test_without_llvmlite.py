"""Without llvmlite, numpy computes the same flights."""

import logging
import subprocess
import sys

import numpy as np
import pytest

from crazyflie_batch import Controller, Kalman, Measurement, Model, program, quadrotor, simulate
from crazyflie_model.dynamics import NearHover

GAINS = np.tile([0.0, 0.1, 0.0, 0.0, 0.3, 0.0, -0.2], (4, 1))

_IMPORT = """
import sys
sys.modules["llvmlite"] = None
from crazyflie_batch import program
print(program.MachineCode)
"""


@pytest.fixture
def without_llvmlite(monkeypatch):
    """Return a function that removes llvmlite for the rest of the test."""

    def remove():
        program.clear()
        monkeypatch.setattr(program, "MachineCode", None)
        monkeypatch.setattr(program, "_MISSING", "No module named 'llvmlite'")

    yield remove
    program.clear()
    program._warn_of_numpy.cache_clear()


def fly():
    """Return flights with all kinds of differences, of more than a group."""
    n = program.ArrayProgram.lanes + 3
    return simulate(
        quadrotor(np.linspace(-0.1, 0.1, n)),
        Controller(GAINS, integrator_k=(0.1, 0.1, -0.5), integrator_limit=(0.5, 0.5, 0.5)),
        Kalman(),
        n=n,
        duration=0.3,
        measurement=Measurement(1e-3, 1e-2, np.linspace(0.0, 0.05, n), 0.1),
        record=True,
        threads=1,
    )


def test_numpy_flies_the_same(without_llvmlite, caplog):
    compiled = fly()
    without_llvmlite()
    with caplog.at_level(logging.WARNING):
        computed = fly()
        fly()
    (line,) = caplog.messages
    assert line.startswith("llvmlite is missing (No module named 'llvmlite')")
    for name in ("states", "controls", "x", "largest_error", "largest_tilt", "largest_speed"):
        expected = getattr(compiled, name)
        np.testing.assert_allclose(getattr(computed, name), expected, rtol=1e-9, atol=1e-9)


class Branching(NearHover):
    """A model of a user that asks for a value."""

    def rates(self, t, x, u):
        """See `Dynamics.rates`."""
        return super().rates(t, x, u if x[2] > 0.5 else [0.0] * 4)


def test_a_model_that_branches_is_refused_by_name(without_llvmlite):
    without_llvmlite()
    with pytest.raises(TypeError, match=r"the formula Branching\.rates \(.*cannot be computed"):
        simulate(Model(Branching), Controller(GAINS))


def test_the_package_is_imported_without_llvmlite():
    printed = subprocess.run([sys.executable, "-c", _IMPORT], check=True, capture_output=True)
    assert printed.stdout == b"None\n"
