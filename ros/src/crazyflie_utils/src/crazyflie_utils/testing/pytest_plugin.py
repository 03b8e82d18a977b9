"""What every unit test of the workspace rests on: a plugin of pytest.

Hypothesis tries the same examples every time, however long a machine takes over one.
Ctrl-C reaches the programs that tests start, also when the tests themselves were started
in the background of a script, where a shell has it ignored.
"""

import signal

from hypothesis import HealthCheck, settings

settings.register_profile(
    "workspace",
    database=None,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("workspace")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
