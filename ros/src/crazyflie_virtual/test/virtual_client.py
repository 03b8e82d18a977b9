"""A cflib program, every wait of which has a limit."""

import contextlib
import threading

import cflib.crtp
from cflib.crazyflie import Crazyflie
from cflib.crazyflie.log import LogConfig
from cflib.crtp.crtpstack import CRTPPacket

from crazyflie_utils.testing.programs import LIMIT
from crazyflie_virtual.testing import virtual_vehicle


class Client:
    """A cflib client, and the events it was notified of."""

    def __init__(self, uri, cache=None):
        cflib.crtp.init_drivers()
        self.uri = uri
        self.cf = Crazyflie(rw_cache=cache)
        self.events = {}
        self.text = ""
        self._changed = threading.Condition()
        callbacks = ("connected", "fully_connected", "connection_failed", "connection_lost")
        for name in callbacks:
            getattr(self.cf, name).add_callback(lambda *a, name=name: self._record(name, a))
        self.cf.console.receivedChar.add_callback(self._print)

    def _record(self, name, arguments):
        with self._changed:
            self.events[name] = arguments
            self._changed.notify()

    def _print(self, text):
        self.text += text

    def open(self):
        """Begin to connect."""
        self.cf.open_link(self.uri)
        return self

    def close(self):
        """Hang up."""
        if self.cf.link is None:
            return
        # cflib waits for the next packet, or a second: an echo comes meanwhile.
        ping = CRTPPacket(0xF0, bytes(9))
        echo = threading.Timer(0.15, self.cf.link.send_packet, [ping])
        echo.start()
        self.cf.close_link()
        echo.cancel()

    def wait_for(self, event):
        """Wait until cflib has called back; return the arguments."""
        with self._changed:
            assert self._changed.wait_for(lambda: event in self.events, LIMIT), self.events
        return self.events[event]

    def log(self, *variables, period=10):
        """Log variables; return the list of (timestamp, values) that grows."""
        config = LogConfig(variables[0], period)
        for variable in variables:
            config.add_variable(variable)
        rows = []
        config.data_received_cb.add_callback(lambda stamp, data, _: rows.append((stamp, data)))
        self.cf.log.add_config(config)
        config.start()
        return rows

    def set(self, name, value):
        """Set a parameter and wait until the vehicle has confirmed it."""
        confirmation = threading.Event()
        group, parameter = name.split(".")

        def confirm(_, confirmed):
            if float(confirmed) == value:
                confirmation.set()

        self.cf.param.add_update_callback(group, parameter, confirm)
        self.cf.param.set_value(name, value)
        assert confirmation.wait(LIMIT), f"{name} was not set"
        self.cf.param.remove_update_callback(group, parameter, confirm)


@contextlib.contextmanager
def connected_vehicle(**settings):
    """Run a vehicle; yield it, and a client that is fully connected to it."""
    with virtual_vehicle(**settings) as (server, uri), contextlib.closing(Client(uri)) as client:
        client.open().wait_for("fully_connected")
        yield server.vehicle, client
