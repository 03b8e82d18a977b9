"""Groups of vehicles, as the firmware's high-level commander has them."""

from collections.abc import Callable
from typing import Any

from crazyflie_driver import srv

_ALL = 0  #: Mask of a command to all vehicles.


class Groups:
    """The groups that a vehicle belongs to: none at first."""

    def __init__(self) -> None:
        self._mask = 0

    def on_set_group_mask(self, request: srv.SetGroupMaskRequest) -> srv.SetGroupMaskResponse:
        """Answer a service call."""
        self._mask = request.groupMask
        return srv.SetGroupMaskResponse()

    def for_members(
        self, service_type: Any, callback: Callable[[Any], Any]
    ) -> Callable[[Any], Any]:
        """Return a callback that ignores requests to other groups, as the firmware does."""

        def on_request(request):
            if request.groupMask == _ALL or request.groupMask & self._mask:
                return callback(request)
            return service_type._response_class()

        return on_request
