"""The base class of all nodes."""

import pytest
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import ReconfigureRequest
from std_msgs.msg import String

from crazyflie_utils.node import Node
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import POSITIVE


class Echo(Node):
    """Repeats what it hears, and says "safe" when it must be safe."""

    def __init__(self, fails_in=""):
        super().__init__()
        self._fails_in = fails_in
        self._publisher = None
        self.order = []

    def load_parameters(self, handle):
        self.order.append("parameters")
        self.gain = handle.get_param("~gain", POSITIVE)
        if self._fails_in == "parameters":
            raise RuntimeError("no algorithm")

    def register_callbacks(self, handle):
        self.order.append("callbacks")
        self._publisher = handle.publisher("out", String, latch=True)
        handle.subscribe("in", String, self._on_message)
        if self._fails_in == "callbacks":
            raise TypeError("topic clash")
        self.order.append("complete")

    def enter_safe_state(self):
        self._publisher.publish(String("safe"))
        if self._fails_in == "enter_safe_state":
            raise RuntimeError("not safe")

    def _on_message(self, message):
        self.order.append(message.data)
        if message.data == "fail":
            raise RuntimeError(message.data)
        self._publisher.publish(message)


def texts(process):
    return [message.data for message in process.published("/ns/out")]


def test_loads_then_registers_then_lives(process):
    node = Echo()
    assert process.launch(node, "/ns/echo", {"gain": 2})
    assert node.order == ["parameters", "callbacks", "complete"]
    process.publish("/ns/in", String("x"))
    assert texts(process) == ["x"]
    assert process.logged("error") == []


def test_bad_parameter_is_named_and_nothing_is_registered(process):
    assert not process.launch(Echo(), "/ns/echo", {"gain": -1.0})
    assert process.logged("error") == [
        "/ns/echo: parameter /ns/echo/gain is -1.0; expected a finite number > 0"
    ]
    assert process.transport.publishers == {}
    assert list(process.transport.subscribers) == ["/clock"]


@pytest.mark.parametrize(
    ("step", "error"), [("parameters", "no algorithm"), ("callbacks", "topic clash")]
)
def test_any_other_error_stops_the_node_with_a_traceback(process, step, error):
    assert not process.launch(Echo(fails_in=step), "/ns/echo", {"gain": 1.0})
    (text,) = process.logged("error")
    assert text.startswith("/ns/echo: failed to initialize\nTraceback")
    assert error in text


def test_a_latched_message_waits_until_the_node_is_complete(process):
    process.handle("/other").publisher("/ns/in", String, latch=True).publish(String("early"))
    node = Echo()
    assert process.launch(node, "/ns/echo", {"gain": 1.0})
    assert node.order == ["parameters", "callbacks", "complete", "early"]


def test_is_made_safe_after_a_fault_and_lives_on(process):
    assert process.launch(Echo(), "/ns/echo", {"gain": 1.0})
    for text in ("a", "fail", "b"):
        process.publish("/ns/in", String(text))
    assert texts(process) == ["a", "safe", "b"]


def test_shutdown_makes_safe(process):
    node = Echo()
    assert process.launch(node, "/ns/echo", {"gain": 1.0})
    node.shutdown()
    assert texts(process) == ["safe"]


def test_every_node_is_shut_down_though_one_fails(process):
    nodes = {"/ns/a": Echo(fails_in="enter_safe_state"), "/ns/b": Echo()}
    for name, node in nodes.items():
        assert process.launch(node, name, {"gain": 1.0})
    ticks = []
    process.handle("/ns/a").timer(0.1, lambda: ticks.append(1))
    process.shut_down(nodes)
    assert texts(process) == ["safe", "safe"]
    (error,) = process.logged("error")
    assert "shutdown failed" in error
    assert "not safe" in error
    process.advance(1.0)
    assert ticks == []


class Talker(Node):
    """Could say something."""

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        handle.publisher("out", String)


def test_messages_of_shutdown_still_reach_the_other_nodes(process):
    node = Echo()
    assert process.launch(node, "/ns/echo", {"gain": 1.0})
    heard = []
    process.handle("/other").subscribe(
        "/ns/out", String, lambda message: heard.append(message.data)
    )
    process.shut_down({"/ns/echo": node})
    assert heard == ["safe"]


def test_default_is_silence(process):
    node = Talker()
    assert process.launch(node, "/ns/talker")
    node.enter_safe_state()
    process.shut_down({"/ns/talker": node})
    assert process.published("/ns/out") == []
    assert process.logged("error") == []


def test_subclasses_must_say_what_they_do(process):
    with pytest.raises(NotImplementedError):
        Node().register_callbacks(None)
    assert not process.launch(Node(), "/ns/node")
    assert "has no attribute 'parameters_type'" in process.logged("error")[0]


class GainParameters(Parameters):
    """Parameters of `Amplifier`."""

    gain: float = parameter(POSITIVE, "", live=True)
    offset: float = parameter(POSITIVE, "", 1.0)


class Amplifier(Node[GainParameters]):
    """A node without an algorithm."""

    def register_callbacks(self, handle):
        handle.info(f"gain {self._parameters.gain:g}, offset {self._parameters.offset:g}")
        handle.timer(1.0, lambda: handle.info(f"gain {self._parameters.gain:g}"))


class LoudAmplifier(Amplifier):
    """One whose declaration is that of its base class."""


class OffsetParameters(Parameters):
    """Parameters that cannot be changed."""

    offset: float = parameter(POSITIVE, "", 1.0)


class Offset(Node[OffsetParameters]):
    """A node that offers no changes."""

    def register_callbacks(self, handle):
        pass


@pytest.mark.parametrize("node_class", [Amplifier, LoudAmplifier])
def test_the_declared_parameters_are_loaded_and_replaced(process, node_class):
    assert process.launch(node_class(), "/ns/amplifier", {"gain": 2.0})
    assert process.logged("info") == ["/ns/amplifier: gain 2, offset 1"]
    request = ReconfigureRequest(Config(doubles=[DoubleParameter("gain", 3.0)]))
    process.call("/ns/amplifier/set_parameters", request)
    process.advance(1.0)
    assert process.logged("info")[1:] == ["/ns/amplifier: gain 3"]


def test_a_node_without_live_parameters_offers_no_changes(process):
    assert process.launch(Offset(), "/ns/offset")
    assert process.transport.publishers == {}
