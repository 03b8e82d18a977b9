"""Settings of the property tests: a busy computer is not a failure."""

from hypothesis import settings

settings.register_profile("model", parent=settings.default, deadline=None)
settings.load_profile("model")
