"""A server of this package as a ROS node: options from parameters, switches while it runs."""

import dataclasses

from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import BOOLEAN, Integer, Number, Text
from crazyflie_utils.parameters import ParameterError
from crazyflie_virtual.options import key_of

_POLL_PERIOD = 0.5
"""How often the switches are read, s."""

SWITCHES = "fault"
"""Options below this name are switches: they may be changed while the node runs."""


class ServerNode(Node):
    """Runs a server in a thread of its own.

    Parameters
    ----------
    options_class : type
        See `options`.
    server_class : type
        ``server_class(options, warn)`` listens, or raises `OSError`; has ``start``, ``stop``,
        ``description`` and ``switches``, an object with an attribute for every
        switch.
    """

    def __init__(self, options_class: type, server_class: type):
        super().__init__()
        self._options_class = options_class
        self._server_class = server_class
        self._fields = dataclasses.fields(options_class)
        self._switches = None
        self._options = None
        self._server = None
        self._last = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        values = {f.name: handle.param(key_of(f), kind_of(f), f.default) for f in self._fields}
        self._options = self._options_class(**values)
        prefix = SWITCHES + "/"
        switches = [f for f in self._fields if key_of(f).startswith(prefix)]
        self._switches = _Switches({key_of(f).removeprefix(prefix): f for f in switches})
        self._last = {f.name: values[f.name] for f in switches}

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        try:
            self._server = self._server_class(
                self._options, lambda text: handle.warn(text, throttle=1.0)
            )
        except OSError as error:
            raise ParameterError(
                f"{handle.name} cannot listen: {error}; is another one running? If not, "
                "choose another port"
            ) from None
        self._server.start()
        handle.info(self._server.description)
        handle.timer(_POLL_PERIOD, self._poll, steady=True)

    def shutdown(self) -> None:
        """Close the sockets."""
        self._server.stop()

    def _poll(self):
        try:
            values = self._handle.param(SWITCHES, self._switches, {})
        except ParameterError as error:
            self._handle.warn(str(error), throttle=5.0)
            return
        # Only what has changed, since clients may have set switches as well.
        for name, value in values.items():
            if value != self._last[name]:
                self._last[name] = value
                setattr(self._server.switches, name, value)


def kind_of(field):
    """Return the kind of parameter of an option's field; see `crazyflie_utils.parameters`."""
    low, high = field.metadata["limits"]
    if isinstance(field.default, bool):
        return BOOLEAN
    if isinstance(field.default, int):
        return Integer(low, high)
    if isinstance(field.default, float):
        return Number(minimum=low, maximum=high)
    choices = field.metadata["choices"]
    return Text(choices) if choices or field.default else _AnyText()


class _AnyText:
    def __call__(self, value):
        if not isinstance(value, str):
            raise ValueError
        return value

    def __str__(self):
        return "a string"


class _Switches:
    # The dictionary of all switches: read in one request to the parameter server.

    def __init__(self, fields):
        self._fields = fields

    def __call__(self, value):
        if not isinstance(value, dict):
            raise ValueError
        values = {}
        for key, raw in value.items():
            field = self._fields.get(key)
            if field is None:
                raise ValueError(f"there is no switch {key}")
            kind = kind_of(field)
            try:
                values[field.name] = kind(raw)
            except ValueError:
                raise ValueError(f"{key} must be {kind}") from None
        return values

    def __str__(self):
        return "a dictionary with some of " + ", ".join(self._fields)
