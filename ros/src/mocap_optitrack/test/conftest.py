"""Property tests make the same examples on every run, however slow the machine."""

from hypothesis import settings

settings.register_profile("workspace", deadline=None, derandomize=True)
settings.load_profile("workspace")
