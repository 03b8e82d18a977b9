"""A node that makes the server add one vehicle, and ends."""

from concurrent.futures import Future
from functools import partial

from typing_extensions import override

from crazyflie_driver.driver_parameters import (
    ADD,
    KALMAN_FILTER,
    POSITIONING_PARAMETER,
    CrazyflieAddParameters,
)
from crazyflie_driver.positioning import ESTIMATOR, KALMAN
from crazyflie_driver.srv import AddCrazyflie, UpdateParams, UpdateParamsRequest
from crazyflie_utils import Node, NodeHandle, ServiceError
from crazyflie_utils.steps import follow

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
        self._answer = follow(self._add(), handle.submit)
        self._answer.add_done_callback(partial(handle.submit, self._on_answer))

    def _add(self):
        """Add the vehicle, in steps."""
        handle, parameters = self._handle, self._parameters
        yield handle.call_service(ADD, AddCrazyflie, parameters.request(), _LIMIT)
        if parameters.estimator == KALMAN_FILTER:
            name, service = ESTIMATOR.replace(".", "/"), f"{parameters.prefix}/update_params"
            yield handle.set_param_later(f"{parameters.prefix}/{name}", KALMAN)
            try:
                yield handle.call_service(
                    service, UpdateParams, UpdateParamsRequest([name]), _LIMIT
                )
            except ServiceError as error:
                raise ServiceError(f"it is added, but {name} is not set: {error}") from None

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
