"""The anatomy that all nodes share."""

import traceback
from typing import ClassVar

from crazyflie_utils.handle import NodeHandle
from crazyflie_utils.parameters.declaration import ParameterError
from crazyflie_utils.program import missing_module


def initialization_failure(error: Exception) -> str:
    """Return why a node cannot be initialized: what is to be installed, or the traceback."""
    trace = "".join(traceback.format_exception(error))
    return missing_module(error) or f"failed to initialize\n{trace}"


class Node:
    """A ROS node as an object: give it a `NodeHandle` and it is one.

    A subclass overrides `load_parameters`, `register_callbacks` and, if silence is not safe enough,
    `enter_safe_state`. ``__init__`` holds what changes while the node runs, and makes no ROS call.

    Callbacks never run before `initialize` has returned and never at the same time, so a node
    needs no locks.
    """

    #: Whether a process with this node lives on after SIGINT until flights have ended.
    needed_in_flight: ClassVar[bool] = False

    _handle: NodeHandle

    def initialize(self, handle: NodeHandle) -> bool:
        """Load parameters, register callbacks; False if it cannot run, the reason is in the log."""
        self._handle = handle
        try:
            self.load_parameters(handle)
            self.register_callbacks(handle)
        except ParameterError as error:
            handle.error(str(error))
            return False
        except Exception as error:
            handle.error(initialization_failure(error))
            return False
        handle.on_fault(self.enter_safe_state)
        return True

    def load_parameters(self, handle: NodeHandle) -> None:
        """Load the parameters, with `NodeHandle.load`, and build the algorithm.

        May raise `ParameterError`, with full names and what was expected.
        """
        raise NotImplementedError

    def register_callbacks(self, handle: NodeHandle) -> None:
        """Create publishers, services, subscribers and timers, in this order."""
        raise NotImplementedError

    def enter_safe_state(self) -> None:
        """Leave the vehicle safe after a callback has raised, and at shutdown.

        By default the node falls silent; the vehicle's watchdog does the rest.
        """

    def prepare_shutdown(self) -> None:
        """End what needs time, such as a flight: called at SIGINT, when all goes on for a while."""

    def shutdown(self) -> None:
        """End: called once, when timers no longer fire and topics still work."""
        self.enter_safe_state()
