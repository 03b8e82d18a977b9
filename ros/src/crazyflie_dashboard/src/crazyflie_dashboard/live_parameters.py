"""Live parameters: of nodes by dynamic_reconfigure, of the firmware by the driver."""

from concurrent.futures import Executor, Future
from dataclasses import replace
from functools import partial
from typing import Any

from dynamic_reconfigure.msg import Config, ConfigDescription
from dynamic_reconfigure.srv import Reconfigure, ReconfigureRequest

from crazyflie_dashboard.answers import Steps
from crazyflie_dashboard.graph_model import GraphModel
from crazyflie_dashboard.master import Master
from crazyflie_dashboard.page_data import ParameterInfo
from crazyflie_dashboard.parameters import described, of_firmware, parsed, values_of
from crazyflie_driver.srv import UpdateParams, UpdateParamsRequest
from crazyflie_utils import NodeHandle, ServiceError
from crazyflie_utils.parameters.server import config_message
from crazyflie_utils.refusal import RefusalError

_TIMEOUT = 3.0  #: Longest time for a latched message of a node, by the machine's clock (s).
_CALL_TIMEOUT = 5.0  #: Longest time for a change (s).

_SERVICE = "/set_parameters"


class LiveParameters:
    """Reads and sets parameters; see `Dashboard.parameters`."""

    def __init__(self, handle: NodeHandle, workers: Executor, master: Master, model: GraphModel):
        self._handle, self._workers, self._master, self._model = handle, workers, master, model

    def owners(self) -> tuple[str, ...]:
        """Return nodes with live parameters, and vehicles with firmware."""
        services = self._model.graph.services
        nodes = [name.removesuffix(_SERVICE) for name in services if name.endswith(_SERVICE)]
        return (*self._firmware(), *sorted(nodes))

    def of(self, owner: str) -> Steps[tuple[ParameterInfo, ...]]:
        """Return the parameters of a node or of a vehicle's firmware."""
        owners = self.owners()
        if owner not in owners:
            raise RefusalError(
                f"{owner} has no live parameters; expected one of {', '.join(owners)}"
            )
        if owner not in self._firmware():
            return (yield from self._of_node(owner))
        top = self._firmware()[owner] or "/"
        known = yield self._workers.submit(self._master.parameters, [top])
        tree = known.get(top)
        return tuple(of_firmware(owner, tree if isinstance(tree, dict) else {}))

    def set(self, parameter: ParameterInfo, text: str) -> Steps[ParameterInfo]:
        """Set a parameter to the typed value; the result has the value that came back."""
        value = parsed(parameter, text)
        if parameter.is_firmware:
            return (yield from self._set_firmware(parameter, value))
        service, config = f"{parameter.owner}{_SERVICE}", config_message({parameter.name: value})
        answer = yield self._handle.call_service(
            service, Reconfigure, ReconfigureRequest(config), _CALL_TIMEOUT
        )
        return replace(parameter, value=values_of(answer.config).get(parameter.name, value))

    def _firmware(self):
        """Return the namespaces of drivers, by vehicle."""
        services = self._model.graph.services
        drivers = {name: model.vehicle.driver for name, model in [*self._model.models.items()]}
        return {name: top for name, top in drivers.items() if f"{top}/update_params" in services}

    def _set_firmware(self, parameter, value):
        if parameter.owner not in self._firmware():
            raise RefusalError(f"{parameter.owner} has no driver; expected one")
        top, name = self._firmware()[parameter.owner], parameter.name.replace(".", "/")
        full_name = f"{top}/{name}"
        yield self._handle.set_param_later(full_name, value)
        try:
            yield self._handle.call_service(
                f"{top}/update_params", UpdateParams, UpdateParamsRequest([name]), _CALL_TIMEOUT
            )
        except ServiceError:
            # The firmware's value, which may differ from the typed one.
            yield self._handle.set_param_later(full_name, parameter.value)
            raise
        known = yield self._workers.submit(self._master.parameters, [full_name])
        return replace(parameter, value=known.get(full_name, value))

    def _of_node(self, node):
        handle = self._handle.child()
        end: Future[None] = Future()
        received: dict[str, Any] = {}

        def finish():
            if not end.done():
                end.set_result(None)

        def note(name, message):
            received[name] = message
            if len(received) == 2:
                finish()

        note_description, note_config = (partial(note, each) for each in ("description", "config"))
        handle.subscribe(f"{node}/parameter_descriptions", ConfigDescription, note_description)
        handle.subscribe(f"{node}/parameter_updates", Config, note_config)
        handle.timer(_TIMEOUT, finish, steady=True)
        yield end
        handle.close()
        return tuple(described(node, **received)) if len(received) == 2 else ()
