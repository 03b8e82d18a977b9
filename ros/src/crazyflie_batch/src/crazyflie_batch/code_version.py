"""The version of the simulated code, so that results of two versions are not mixed."""

import ast
import hashlib
import importlib.util
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

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
def code_version(module: str = "crazyflie_batch.monte_carlo") -> str:
    """Return a hash of the source of a module, and of all that it imports of `FLOWN_PACKAGES`.

    The hash includes numpy's version, since random numbers may differ between versions.
    """
    digest = hashlib.sha256(np.__version__.encode())
    for name, source in sorted(sources(module).items()):
        digest.update(f"\0{name}\0".encode())
        digest.update(source)
    return digest.hexdigest()


def sources(module: str) -> dict[str, bytes]:
    """Return the source of a module, and of all that it imports of `FLOWN_PACKAGES`, by name."""
    found: dict[str, bytes] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = _path(name)
        if name not in found and path is not None:
            found[name] = path.read_bytes()
            waiting += _imported(found[name])
    return found


def _path(name: str) -> Path | None:
    """Return the file of a module; None for other packages and other objects."""
    if name.partition(".")[0] not in FLOWN_PACKAGES:
        return None
    try:
        spec = importlib.util.find_spec(name)
    except ModuleNotFoundError:
        return None
    # A package in a workspace that is not installed has another __init__.py.
    if spec is None or spec.origin is None or spec.submodule_search_locations is not None:
        return None
    return Path(spec.origin)


def _imported(source: bytes) -> Iterator[str]:
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield node.module
            # An imported name may be a module.
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
