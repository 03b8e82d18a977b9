"""The version of the simulated code, so that results of two versions are not mixed."""

import hashlib
from functools import lru_cache
from importlib import import_module
from modulefinder import ModuleFinder
from pathlib import Path
from typing import Any

import numpy as np

#: Packages whose modules affect a flight; the others only read settings.
FLOWN_PACKAGES = (
    "crazyflie_batch",
    "crazyflie_lqr",
    "crazyflie_model",
    "crazyflie_state_estimator",
)


class OtherFlightsError(Exception):
    """The folder has flights with other settings, or of another version of the code."""


@lru_cache(maxsize=1)
def code_version() -> str:
    """Return a hash of the source of `monte_carlo` and of all that it imports; see `sources`.

    The hash includes numpy's version, since random numbers may differ between versions.
    """
    digest = hashlib.sha256(np.__version__.encode())
    for name, source in sorted(sources("crazyflie_batch.monte_carlo").items()):
        digest.update(f"\0{name}\0".encode())
        digest.update(source)
    return digest.hexdigest()


def sources(module: str) -> dict[str, bytes]:
    """Return the source of a module, and of all that it imports of `FLOWN_PACKAGES`, by name."""
    # Other packages are not found in these folders.
    folders = [str(Path(import_module(each).__path__[-1]).parent) for each in FLOWN_PACKAGES]
    finder = ModuleFinder(folders)
    finder.import_hook(module)
    modules: dict[str, Any] = finder.modules
    # Built-in modules have no file. A package in a workspace that is not installed has another
    # __init__.py.
    return {
        name: Path(each.__file__).read_bytes()
        for name, each in modules.items()
        if each.__file__ and not each.__path__
    }
