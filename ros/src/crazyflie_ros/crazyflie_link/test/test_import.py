"""Effects of importing the package on the process."""

import subprocess
import sys

import pytest

IMPORT = """
import sys, warnings
import {module}
assert "cflib.crtp" in sys.modules
always = [entry for entry in warnings.filters if entry[:3] == ("always", None, DeprecationWarning)]
assert not always, always
"""


@pytest.mark.parametrize("module", ["crazyflie_link.crazyflie", "crazyflie_link.cflib_internals"])
def test_deprecation_warnings_stay_off(module):
    """In a process of its own: modules are imported once."""
    done = subprocess.run(
        [sys.executable, "-c", IMPORT.format(module=module)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
