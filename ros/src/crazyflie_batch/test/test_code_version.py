"""The version of the code is that of all modules that take part in a flight."""

import subprocess
import sys

import pytest

from crazyflie_batch import code_version as module
from crazyflie_batch.code_version import FLOWN_PACKAGES, code_version, sources

_IMPORT = """
import crazyflie_batch.monte_carlo, sys
print(*(name for name, each in sys.modules.items() if not hasattr(each, "__path__")))
"""


@pytest.fixture(autouse=True)
def _anew():
    code_version.cache_clear()
    yield
    code_version.cache_clear()


def test_it_is_made_from_all_modules_that_fly():
    printed = subprocess.run(
        [sys.executable, "-c", _IMPORT], check=True, capture_output=True, text=True
    ).stdout
    imported = {name for name in printed.split() if name.partition(".")[0] in FLOWN_PACKAGES}
    assert "crazyflie_model.inner_loops" in imported
    assert set(sources("crazyflie_batch.monte_carlo")) == imported


def test_a_module_that_is_changed_is_another_version(monkeypatch):
    before = code_version()
    code_version.cache_clear()
    assert code_version() == before
    code_version.cache_clear()
    found = sources("crazyflie_batch.monte_carlo")
    found["crazyflie_model.limits"] += b"# 2 mm more\n"
    monkeypatch.setattr(module, "sources", lambda name: found)
    assert code_version() != before
