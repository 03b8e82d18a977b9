"""The anatomy that all nodes share."""

import traceback

from crazyflie_utils.parameters import ParameterError


class Node:
    """A ROS node as an object: give it a `NodeHandle` and it is one.

    A subclass

    1. assigns every attribute in ``__init__``, without a ROS call;
    2. loads and checks its parameters in `load_parameters`, and builds its
       algorithm from them;
    3. announces itself in `register_callbacks`: publishers, then services,
       then subscribers, timers last;
    4. if silence is not safe enough, says what is in `make_safe`.

    Callbacks never run before `initialize` is through and never at the same
    time, so a node needs no locks.
    """

    def __init__(self):
        self._handle = None

    def initialize(self, handle) -> bool:
        """Become a living node.

        Parameters
        ----------
        handle : NodeHandle

        Returns
        -------
        bool
            False when the node must not run; the reason is in the log.
        """
        self._handle = handle
        try:
            self.load_parameters(handle)
            self.register_callbacks(handle)
        except ParameterError as error:
            handle.error(str(error))
            return False
        except Exception:
            handle.error(f"failed to initialize\n{traceback.format_exc()}")
            return False
        handle.on_fault(self.make_safe)
        return True

    def load_parameters(self, handle) -> None:
        """Read every parameter and check its presence, type, range and shape.

        Raises
        ------
        ParameterError
            With the full name of the parameter and what was expected.
        """
        raise NotImplementedError

    def register_callbacks(self, handle) -> None:
        """Create publishers, services, subscribers and timers, in this order."""
        raise NotImplementedError

    def make_safe(self) -> None:
        """Leave the vehicle safe after a callback has raised, and at shutdown.

        By default the node falls silent; the vehicle's watchdog does the rest.
        """

    def shutdown(self) -> None:
        """End: called once, when timers no longer fire and topics still work."""
        self.make_safe()
