"""A server of this package as a ROS node: settings from parameters, switches while it runs."""

from typing import ClassVar

from typing_extensions import override

from crazyflie_utils.handle import NodeHandle
from crazyflie_utils.node import Node
from crazyflie_utils.parameters.declaration import ParameterError, Parameters
from crazyflie_virtual.server import Server

_POLL_PERIOD = 0.5  #: How often the switches are read, s.


class ServerNode(Node):
    """Runs a server; switches are polled, so that ``rosparam set`` works on them, too."""

    needed_in_flight = True

    settings_type: ClassVar[type[Parameters]]  #: Subclass of `Parameters`.
    #: ``server_type(settings, warn)`` listens, or raises `OSError`; ``warn(text)`` logs.
    server_type: ClassVar[type]

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._settings = handle.load(self.settings_type, self._reconfigure)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        try:
            self._server: Server = self.server_type(
                self._settings, lambda text: handle.warn(text, throttle=1.0)
            )
        except OSError as error:
            raise ParameterError(
                f"{handle.name} cannot listen: {error}; is another one running? If not, "
                "choose another port"
            ) from None
        self._server.start()
        handle.info(self._server.description)
        handle.timer(_POLL_PERIOD, self._poll, steady=True)

    @override
    def shutdown(self) -> None:
        self._server.stop()

    def _reconfigure(self, _):
        # After this callback the change is on the parameter server, where _poll compares
        # it with what was there: one rule for both ways of changing a switch.
        self._handle.submit(self._poll)

    def _poll(self):
        try:
            settings = self._handle.load(self.settings_type)
        except ParameterError as error:
            self._handle.warn(str(error), throttle=5.0)
            return
        # Only what has changed, since clients may have set switches as well.
        for name in vars(self._server.switches):
            value = getattr(settings, name)
            if value != getattr(self._settings, name):
                setattr(self._server.switches, name, value)
        self._settings = settings
