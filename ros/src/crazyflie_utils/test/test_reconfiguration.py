"""Parameters that are changed while a node runs, by the messages of dynamic_reconfigure."""

import ast

import pytest
from dynamic_reconfigure import encoding
from dynamic_reconfigure.msg import Config, DoubleParameter, StrParameter
from dynamic_reconfigure.srv import ReconfigureRequest

from crazyflie_utils import ParameterError, Parameters, ServiceError, parameter
from crazyflie_utils.parameters.types import BOOLEAN, TOPIC, Integer, Number, Text
from crazyflie_utils.testing import FakeProcess


class LimiterParameters(Parameters):
    """Some live, some not."""

    limit: float = parameter(Number("m/s^2", above=0.0), "largest thrust", live=True)
    gain: float = parameter(Number(), "of the loop", default=1, name="loop/gain", live=True)
    mode: str = parameter(Text(("SOFT", "HARD")), "how to limit", default="SOFT", live=True)
    steps: int = parameter(Integer(1, 9), "how often", default=3, live=True)
    is_on: bool = parameter(BOOLEAN, "whether to limit", default=True, live=True)
    topic: str = parameter(TOPIC, "what is limited", name="topics/in")
    shared: float = parameter(Number(), "of all nodes", default=1.0, name="/shared")

    def complaints(self):
        """See `Parameters.complaints`."""
        if self.mode == "HARD" and self.limit > 12.0:
            yield f"limit is {self.limit:g}; expected at most 12 with mode HARD"


class Limiter:
    """A node with live parameters."""

    def __init__(self):
        self.changes = []
        self.refusal = None

    def initialize(self, handle):
        """Load the parameters."""
        self.parameters = handle.load(LimiterParameters, self.reconfigure)
        return True

    def reconfigure(self, parameters):
        """Take a change."""
        if self.refusal is not None:
            raise self.refusal
        self.changes.append(parameters)


@pytest.fixture
def process():
    """Return a process with a limiter in it."""
    process = FakeProcess()
    process.limiter = Limiter()
    process.transport.parameters["/shared"] = 2.0
    assert process.launch(process.limiter, "/limiter", {"limit": 10, "topics/in": "/a"})
    return process


def change(process, **values):
    """Ask for changes; return the configuration that holds then."""
    return encoding.decode_config(process.reconfigure("/limiter", **values).config)


def updates(process):
    """Return the configurations that were announced."""
    messages = process.published("/limiter/parameter_updates")
    return [dict(encoding.decode_config(message)) for message in messages]


def test_the_description_is_the_declaration(process):
    (message,) = process.published("/limiter/parameter_descriptions")
    described = encoding.decode_description(message)["parameters"]
    assert {each["name"]: each["type"] for each in described} == {
        "limit": "double",
        "loop/gain": "double",
        "mode": "str",
        "steps": "int",
        "is_on": "bool",
    }
    limit, _, mode, steps, _ = described
    assert (limit["min"], limit["max"], limit["default"]) == (0.0, float("inf"), 10.0)
    assert limit["description"] == "largest thrust, m/s^2"
    assert (steps["min"], steps["max"], steps["default"]) == (1, 9, 3)
    choices = ast.literal_eval(mode["edit_method"])["enum"]
    assert [choice["value"] for choice in choices] == ["SOFT", "HARD"]


def test_the_configuration_at_the_start_is_announced(process):
    assert updates(process) == [
        {"limit": 10.0, "loop/gain": 1.0, "mode": "SOFT", "steps": 3, "is_on": True}
    ]


def test_a_change_is_checked_and_applied(process):
    config = change(process, limit=11.0, **{"loop/gain": 2.5})
    assert (config["limit"], config["loop/gain"], config["mode"]) == (11.0, 2.5, "SOFT")
    (parameters,) = process.limiter.changes
    assert (parameters.limit, parameters.gain, parameters.topic) == (11.0, 2.5, "/a")
    assert process.transport.parameters["/limiter/limit"] == 11.0
    assert updates(process)[-1]["loop/gain"] == 2.5


def test_a_change_does_not_wait_for_the_master(process, monkeypatch):
    def ask_the_master(*_):
        raise AssertionError("the master was asked")

    for call in ("set_param", "get_param"):
        monkeypatch.setattr(process.transport, call, ask_the_master)
    monkeypatch.setattr(process.transport, "set_param_later", lambda name, value: None)
    assert change(process, limit=11.0)["limit"] == 11.0
    assert process.limiter.changes[-1].shared == 2.0


def test_changes_add_up(process):
    change(process, mode="HARD")
    change(process, limit=12.0)
    assert (process.limiter.changes[-1].mode, process.limiter.changes[-1].limit) == ("HARD", 12.0)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"limit": -1.0}, "parameter /limiter/limit is -1.0; expected a finite number > 0"),
        ({"mode": "WEAK"}, "/limiter/mode is 'WEAK'; expected one of SOFT, HARD"),
        ({"mode": "HARD", "limit": 13.0}, "limit is 13; expected at most 12 with mode HARD"),
        ({"topics/in": "/b"}, "topics/in cannot be changed while /limiter runs; expected names"),
    ],
)
def test_a_bad_change_is_refused_whole(process, values, text):
    with pytest.raises(ServiceError, match=text):
        change(process, steps=9, **values)
    assert process.limiter.changes == []
    assert process.transport.parameters["/limiter/limit"] == 10
    # Programs that show the configuration get what holds.
    assert updates(process)[-1] == updates(process)[0]


def test_not_a_number_is_refused(process):
    request = ReconfigureRequest(Config(doubles=[DoubleParameter("limit", float("nan"))]))
    with pytest.raises(ServiceError, match="/limiter/limit is nan"):
        process.call("/limiter/set_parameters", request)


def test_a_wrong_type_is_refused(process):
    request = ReconfigureRequest(Config(strs=[StrParameter("limit", "high")]))
    with pytest.raises(ServiceError, match="/limiter/limit is 'high'"):
        process.call("/limiter/set_parameters", request)


def test_a_node_may_refuse(process):
    process.limiter.refusal = ParameterError("not in flight")
    with pytest.raises(ServiceError, match="not in flight"):
        change(process, limit=11.0)
    process.limiter.refusal = None
    change(process, steps=4)
    assert process.limiter.changes[-1].limit == 10.0


def test_a_node_without_live_parameters_offers_nothing():
    process = FakeProcess({"/node/limit": 1.0, "/node/topics/in": "/a"})
    process.handle("/node").load(LimiterParameters)
    assert process.transport.services == {}
