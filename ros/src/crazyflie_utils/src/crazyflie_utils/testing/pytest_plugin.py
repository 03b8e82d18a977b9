"""The plugin of pytest for all unit tests of the workspace.

Hypothesis tries few examples, the same every time, however long a machine takes over one.
In the profile that HYPOTHESIS_PROFILE=nightly chooses, it tries more, others each time.
Ctrl-C reaches the programs that tests start, also when the tests themselves were started
in the background of a script, where a shell has it ignored.
"""

import os
import signal

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "workspace",
    database=None,
    deadline=None,
    derandomize=True,
    max_examples=20,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile(
    "nightly",
    parent=settings.get_profile("workspace"),
    derandomize=False,
    max_examples=200,
    print_blob=True,
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "workspace"))


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker of tests that `./run tests` skips."""
    config.addinivalue_line("markers", "long: takes long; only in ./run tests --all")


if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
