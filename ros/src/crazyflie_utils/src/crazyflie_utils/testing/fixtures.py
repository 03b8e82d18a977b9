"""Fixtures for the tests of several packages: a conftest.py imports those that it needs."""

import faulthandler
from collections.abc import Iterator

import pytest

_LIMIT = 120.0  #: Timeout of a test (s).


@pytest.fixture(autouse=True)
def own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Set a folder of the test's own for the tables that links keep."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))


@pytest.fixture(autouse=True)
def time_limit() -> Iterator[None]:
    """End the tests when one hangs."""
    faulthandler.dump_traceback_later(_LIMIT, exit=True)
    yield
    faulthandler.cancel_dump_traceback_later()
