"""A node that makes the server add one vehicle, and ends."""

from concurrent.futures import Future

from typing_extensions import override

from crazyflie_driver.parameters import ADD, POSITIONING_PARAMETER, CrazyflieAddParameters
from crazyflie_driver.srv import AddCrazyflie
from crazyflie_utils import Node, NodeHandle

_LIMIT = 60.0  #: Time limit of the start of the server and of its connecting, s.


def command_again(handle: NodeHandle, package: str, executable: str) -> str:
    """Return the command that runs a node with its name and parameters once more."""
    namespace, _, name = handle.name.rpartition("/")
    below = f" __ns:={namespace}" if namespace else ""
    return f"rosrun {package} {executable}{below} __name:={name}"


class CrazyflieAddNode(Node[CrazyflieAddParameters]):
    """Ask for a vehicle; the process exits with status 1 if that fails."""

    def __init__(self) -> None:
        self._answer: Future[object] | None = None

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        handle.info(f"adding {parameters.uri} as {parameters.tf_prefix or '/'}")
        handle.set_param(f"{parameters.prefix}/{POSITIONING_PARAMETER}", parameters.positioning)
        self._answer = handle.call_service(ADD, AddCrazyflie, parameters.request(), _LIMIT)
        self._answer.add_done_callback(self._on_answer)

    @override
    def shutdown(self) -> None:
        """Log that the vehicle may not have been added, if the process ends before the answer."""
        if self._answer is not None and not self._answer.done():
            self._handle.error(f"ended before {self._parameters.uri} was added: is it connected?")

    def _on_answer(self, done):
        parameters = self._parameters
        error = done.exception()
        if error is None:
            self._handle.info(f"added {parameters.uri} as {parameters.tf_prefix or '/'}")
        else:
            again = command_again(self._handle, "crazyflie_driver", "crazyflie_add")
            self._handle.error(f"cannot add {parameters.uri}: {error}; to try again: {again}")
        self._handle.end(0 if error is None else 1)
