"""Live parameters: of nodes by dynamic_reconfigure, of the firmware by the driver."""

from concurrent.futures import Executor, Future
from dataclasses import replace
from functools import partial
from typing import Any

from dynamic_reconfigure.msg import Config, ConfigDescription
from dynamic_reconfigure.srv import Reconfigure, ReconfigureRequest
from typing_extensions import override

from crazyflie_dashboard.answers import words
from crazyflie_dashboard.graph_model import GraphModel
from crazyflie_dashboard.page_data import ParameterInfo
from crazyflie_dashboard.parameters import described, of_firmware, parsed, values_of
from crazyflie_driver.srv import UpdateParams, UpdateParamsRequest
from crazyflie_utils import NodeHandle, ParameterError
from crazyflie_utils.parameters.server import config_message
from crazyflie_utils.parameters.types import ParameterType
from crazyflie_utils.refusal import RefusalError

_TIMEOUT = 3.0  #: Longest time for a latched message of a node, by the machine's clock (s).
_CALL_TIMEOUT = 5.0  #: Longest time for a change (s).

_SERVICE = "/set_parameters"


class _Raw(ParameterType):
    label = "any"

    @override
    def __call__(self, value: Any) -> Any:
        return value


class LiveParameters:
    """Reads and sets parameters; see `Dashboard.parameters`."""

    def __init__(self, handle: NodeHandle, workers: Executor, model: GraphModel):
        self._handle, self._workers, self._model = handle, workers, model

    def owners(self) -> tuple[str, ...]:
        """Return nodes with live parameters, and vehicles with firmware."""
        services = self._model.graph.services
        nodes = [name.removesuffix(_SERVICE) for name in services if name.endswith(_SERVICE)]
        return (*self._firmware(), *sorted(nodes))

    def of(self, owner: str) -> "Future[tuple[ParameterInfo, ...]]":
        """Return the parameters of a node or of a vehicle's firmware."""
        owners = self.owners()
        if owner not in owners:
            raise RefusalError(
                f"{owner} has no live parameters; expected one of {', '.join(owners)}"
            )
        if owner in self._firmware():
            return self._workers.submit(self._read_firmware, owner)
        return self._of_node(owner)

    def set(self, parameter: ParameterInfo, text: str) -> "Future[ParameterInfo]":
        """Set a parameter to the typed value; the result has the value that came back."""
        value = parsed(parameter, text)
        outcome: Future[ParameterInfo] = Future()
        if parameter.is_firmware:
            if parameter.owner not in self._firmware():
                raise RefusalError(f"{parameter.owner} has no driver; expected one")
            top, name = self._firmware()[parameter.owner], parameter.name.replace(".", "/")
            self._workers.submit(self._handle.set_param, f"{top}/{name}", value).add_done_callback(
                lambda _: self._handle.submit(self._update_firmware, parameter, top, name, outcome)
            )
            return outcome
        service, config = f"{parameter.owner}{_SERVICE}", config_message({parameter.name: value})
        answer = self._handle.call_service(
            service, Reconfigure, ReconfigureRequest(config), _CALL_TIMEOUT
        )

        def confirm(done):
            if done.exception() is not None:
                outcome.set_exception(RefusalError(words(done.exception())))
            else:
                back = values_of(done.result().config)
                outcome.set_result(replace(parameter, value=back.get(parameter.name, value)))

        answer.add_done_callback(confirm)
        return outcome

    def _firmware(self):
        """Return the namespaces of drivers, by vehicle."""
        services = self._model.graph.services
        drivers = {name: model.vehicle.driver for name, model in [*self._model.models.items()]}
        return {name: top for name, top in drivers.items() if f"{top}/update_params" in services}

    def _read_firmware(self, owner):
        tree = self._handle.get_param(self._firmware()[owner] or "/", _Raw(), {})
        return tuple(of_firmware(owner, tree if isinstance(tree, dict) else {}))

    def _update_firmware(self, parameter, top, name, outcome):
        def read(done):
            refusal = done.exception()
            if refusal is not None:
                # The firmware's value, which may differ from the typed one.
                self._handle.set_param(f"{top}/{name}", parameter.value)
                raise RefusalError(words(refusal))
            value = self._handle.get_param(f"{top}/{name}", _Raw())
            return replace(parameter, value=value)

        def finish(done):
            error = done.exception()
            if isinstance(error, ParameterError):
                error = RefusalError(str(error))
            if error is not None:
                outcome.set_exception(error)
            else:
                outcome.set_result(done.result())

        answer = self._handle.call_service(
            f"{top}/update_params", UpdateParams, UpdateParamsRequest([name]), _CALL_TIMEOUT
        )
        answer.add_done_callback(
            lambda done: self._workers.submit(read, done).add_done_callback(finish)
        )

    def _of_node(self, node):
        outcome: Future[tuple[ParameterInfo, ...]] = Future()
        handle = self._handle.child()
        received: dict[str, Any] = {}

        def finish():
            if outcome.done():
                return
            handle.close()
            found = described(node, **received) if len(received) == 2 else ()
            outcome.set_result(tuple(found))

        def note(name, message):
            received[name] = message
            if len(received) == 2:
                finish()

        note_description, note_config = (partial(note, each) for each in ("description", "config"))
        handle.subscribe(f"{node}/parameter_descriptions", ConfigDescription, note_description)
        handle.subscribe(f"{node}/parameter_updates", Config, note_config)
        handle.timer(_TIMEOUT, finish, steady=True)
        return outcome
