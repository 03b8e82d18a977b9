"""Imports rospy without most of what it imports in turn; to be imported before all of ROS.

A process with one node is little more than what it has imported, and of rospy's 30 MiB two thirds
are not needed to fly: numpy (12 MiB) for a list of its types, OpenSSL for a checksum, what reads
package.xml to tell whether Python is interactive.

While rospy is imported, stand-ins take the places of these modules. Afterwards whoever imports one
of them gets the real one, and so does rospy where it turns out to need it. What is there already,
as in a script that has imported numpy itself, stays as it is.
"""

import importlib
import sys
from types import ModuleType
from typing import Any

_LATER = ("html", "roslib.stacks", "ssl", "yaml")
"""What rospy, and what it imports, uses in functions only that are hardly ever called."""

_WITHOUT = ("_hashlib", "numpy")
"""What they do without: hashlib has checksums of its own, genpy only forgets numpy's types."""


class _Later(ModuleType):
    """A module that is loaded when something of it is used."""

    def __getattr__(self, name: str) -> Any:
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(importlib.import_module(self.__name__), name)


class _FloatTypes:
    """Types that genpy takes for a float: as it would have listed them, with numpy's."""

    def __init__(self, types: list[type]):
        self._types = types

    def __contains__(self, number_type: type) -> bool:
        if number_type in self._types:
            return True
        # Of numpy's types there are objects only if somebody has imported it.
        numpy = sys.modules.get("numpy")
        return numpy is not None and issubclass(number_type, (numpy.floating, numpy.integer))


def _import_rospy():
    stand_ins: dict[str, ModuleType | None] = {name: _Later(name) for name in _LATER}
    stand_ins |= dict.fromkeys(_WITHOUT)
    stand_ins = {name: each for name, each in stand_ins.items() if name not in sys.modules}
    has_hashlib = "hashlib" in sys.modules
    sys.modules.update(stand_ins)  # type: ignore[arg-type]  # None is what makes an import fail
    try:
        import genpy.message
        import roslib
        import rospy  # noqa: F401
    finally:
        for name, stand_in in stand_ins.items():
            if sys.modules.get(name) is stand_in:
                del sys.modules[name]
        if not has_hashlib:
            # Others get one with all of OpenSSL.
            sys.modules.pop("hashlib", None)
    if "numpy" in stand_ins:
        genpy.message._valid_float_types = _FloatTypes(genpy.message._valid_float_types)
    if "roslib.stacks" in stand_ins:
        roslib.stacks = stand_ins["roslib.stacks"]
    # It would look into the package.xml of all packages for what is on the path already.
    roslib.launcher._bootstrapped.append("dynamic_reconfigure")


if "genpy" not in sys.modules:
    _import_rospy()
