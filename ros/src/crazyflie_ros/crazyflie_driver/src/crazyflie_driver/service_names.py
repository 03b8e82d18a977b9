"""Names for a vehicle's services that belong to no other node.

rosmaster gives a name to the node that registers it last, and callers of the other node get an
error about md5 sums. A controller in the vehicle's namespace, such as crazyflie_controller, has
services takeoff and land as well.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from typing_extensions import override

from crazyflie_utils import NodeHandle
from crazyflie_utils.parameters.types import ParameterType

#: How often, and how long at most, in s, a controller that has parameters is waited for.
PAUSE, LIMIT = 0.1, 3.0
#: Below the vehicle's namespace: where services go whose names belong to other nodes.
ASIDE = "driver"
_SHARED = {"takeoff", "land"}  #: What controllers call their services, unless they are remapped.


@dataclass(eq=False)
class ServiceNames:
    """Find names for a vehicle's services; all methods block."""

    _handle: NodeHandle
    _prefix: str

    def wait_for_controllers(self, is_over: Callable[[], bool]) -> None:
        """Wait for the services of controllers that are about to come, until ``is_over()``.

        Their parameters are set before they start. They may also have been left by controllers that
        ended long ago: therefore the wait has a limit.
        """
        names = self._handle.get_param(self._prefix or "/", _Controllers(), frozenset())
        awaited = {f"{self._prefix}/{name}" for name in names}
        end = time.monotonic() + LIMIT
        while awaited and not is_over() and time.monotonic() < end:
            awaited = {node for node in awaited if not self._is_ready(node)}
            if awaited:
                time.sleep(PAUSE)

    def _is_ready(self, node):
        offered = {
            service.rpartition("/")[2]
            for service, owner in self._handle.service_nodes().items()
            if owner == node
        }
        return _SHARED <= offered

    def free(self, names: Iterable[str]) -> dict[str, str]:
        """Return the name, such as "takeoff", of each service -> the absolute name that it gets."""
        nodes = self._handle.service_nodes()
        found = {}
        for name in names:
            desired = found[name] = f"{self._prefix}/{name}"
            if desired in nodes:
                found[name] = f"{self._prefix}/{ASIDE}/{name}"
                self._handle.warn(
                    f"{desired} is a service of {nodes[desired]}: the driver's is {found[name]}"
                )
        return found


class _Controllers(ParameterType):
    """A namespace; as a value, the names of the nodes in it that have gains of controllers."""

    label = "dictionary"

    @override
    def __call__(self, value: object) -> frozenset[str]:
        if not isinstance(value, dict):
            raise ValueError
        return frozenset(
            name for name, below in value.items() if isinstance(below, dict) and "PIDs" in below
        )

    def __str__(self) -> str:
        """Return what is expected."""
        return "a namespace"
