"""Recorded behaviour of the real firmware: release 2026.08 in the loop, over cflib.

A test that flies a scenario again has the scenario's name in it as a string, be it
``recorded("name")`` or a parameter; test_recorded_all.py sees to it that every
scenario has one, in a file called test_recorded_*.py.
"""

import functools
import json
import pathlib
from typing import Any

_FILE = pathlib.Path(__file__).parent / "recorded/firmware_2026_08.json"


@functools.cache
def scenarios() -> dict[str, Any]:
    """Return all scenarios by name: their steps in words, and what the firmware did."""
    return json.loads(_FILE.read_text())["scenarios"]


def recorded(name: str) -> dict[str, Any]:
    """Return what the firmware did in a scenario. Positions in m, angles in deg, times in s."""
    return scenarios()[name]["firmware"]
