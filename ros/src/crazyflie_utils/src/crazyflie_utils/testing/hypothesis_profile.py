"""How hypothesis behaves in the workspace's tests: a plugin of pytest.

The same examples every time, and however long a machine takes over one.
"""

from hypothesis import HealthCheck, settings

settings.register_profile(
    "workspace",
    database=None,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("workspace")
