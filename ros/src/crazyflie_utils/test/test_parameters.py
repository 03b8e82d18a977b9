"""Every kind of parameter, with good and bad values."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_utils import Node, Parameters, parameter, topic
from crazyflie_utils.parameters.declaration import ParameterError
from crazyflie_utils.parameters.types import (
    BOOLEAN,
    DURATION,
    FINITE,
    FIRMWARE_NUMBER,
    FRAME,
    METRES,
    POSITIVE,
    SERVICE,
    TEXT,
    TIME_STEP,
    TOPIC,
    Converted,
    Integer,
    Number,
    Text,
)
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.text import shown

NUMBERS = [FINITE, METRES, POSITIVE, DURATION, TIME_STEP, Number(minimum=-1.0, maximum=1.0)]
NOT_NUMBERS = [
    "1,0",
    "1_0",
    "1:30",
    "",
    True,
    False,
    None,
    [1.0],
    {"x": 1.0},
    math.nan,
    math.inf,
    -math.inf,
]
MODE = Text(choices=("MERGE", "LQR"))
SEVEN = Integer(7, 7)
FEW = Integer(1, 5)

GOOD = [
    (FINITE, -2.5, -2.5),
    (FINITE, 3, 3.0),
    (METRES, 0, 0.0),
    (POSITIVE, 1e-9, 1e-9),
    (DURATION, 0.0, 0.0),
    (TIME_STEP, 0.001, 0.001),
    (Number(minimum=-1.0, maximum=1.0), 1, 1.0),
    (SEVEN, 7, 7),
    (SEVEN, 7.0, 7),
    *[(FINITE, text, 0.001) for text in ("1e-3", "0.001", "+.1E-2", " 10e-4 ")],
    *[(SEVEN, text, 7) for text in ("7", "0x07", "007", "7.", "0.7e1")],
    (FIRMWARE_NUMBER, 7, 7),
    (FIRMWARE_NUMBER, 7.0, 7.0),
    (FIRMWARE_NUMBER, True, 1),
    (FIRMWARE_NUMBER, "1e-3", 0.001),
    (FIRMWARE_NUMBER, "0x07", 7),
    (FIRMWARE_NUMBER, "1e39", 1e39),
    (FEW, 1, 1),
    (BOOLEAN, True, True),
    (BOOLEAN, False, False),
    (TEXT, "gains/K.txt", "gains/K.txt"),
    (MODE, "LQR", "LQR"),
    (TOPIC, "/control/final", "/control/final"),
    (TOPIC, "control", "control"),
    (SERVICE, "~land", "~land"),
    (FRAME, "world", "world"),
    (FRAME, "/world", "world"),
    (FRAME, "crazyflie/base_link", "crazyflie/base_link"),
]

BAD = [
    *[(kind, value) for kind in NUMBERS for value in NOT_NUMBERS],
    (FINITE, 10**400),
    (POSITIVE, 0.0),
    (POSITIVE, -1),
    (DURATION, -0.1),
    (TIME_STEP, 0),
    (TIME_STEP, -0.01),
    (TIME_STEP, 1e-9),
    (Number(minimum=-1.0, maximum=1.0), 1.1),
    (Number(minimum=-1.0, maximum=1.0), -1.1),
    *[(SEVEN, value) for value in [*NOT_NUMBERS, 6, 8, 7.5]],
    *[(FEW, value) for value in [0, 6, 2.5]],
    *[(BOOLEAN, value) for value in [0, 1, "true", None, []]],
    *[(TEXT, value) for value in ["", "  ", 3, None, True, []]],
    *[(MODE, value) for value in ["lqr", "", "MERGE ", 1]],
    *[(TOPIC, value) for value in ["", "a b", "1st", "a//b", 3, None, ["/a"]]],
    *[(FRAME, value) for value in ["", "/", " ", 3, None]],
]

EXPECTATIONS = [
    (FINITE, "a finite number"),
    (METRES, "a finite number (m)"),
    (POSITIVE, "a finite number > 0"),
    (DURATION, "a finite number >= 0 (s)"),
    (TIME_STEP, "a finite number >= 0.0001 (s)"),
    (Number(minimum=-1.0, maximum=0.5), "a finite number >= -1 and <= 0.5"),
    (SEVEN, "the integer 7"),
    (FEW, "an integer from 1 to 5"),
    (BOOLEAN, "true or false"),
    (TEXT, "a string that is not empty"),
    (MODE, "one of MERGE, LQR"),
    (TOPIC, "the name of a topic or service, such as /state"),
    (FRAME, "the name of a tf frame, such as world"),
]


@pytest.mark.parametrize(("kind", "raw", "value"), GOOD)
def test_good_values(kind, raw, value):
    result = kind(raw)
    assert result == value
    assert type(result) is type(value)


@pytest.mark.parametrize(("kind", "raw"), BAD)
def test_bad_values_are_refused(kind, raw):
    with pytest.raises(ValueError):
        kind(raw)


@pytest.mark.parametrize(("kind", "text"), EXPECTATIONS)
def test_text_says_what_is_expected(kind, text):
    assert str(kind) == text


@given(st.floats(), st.floats(-10, 10), st.floats(-10, 10), st.floats(-10, 10))
def test_number_takes_what_is_in_range(value, above, minimum, maximum):
    kind = Number(above=above, minimum=minimum, maximum=maximum)
    is_good = math.isfinite(value) and minimum <= value <= maximum and value > above
    try:
        result = kind(value)
    except ValueError:
        assert not is_good
    else:
        assert is_good
        assert result == value


@pytest.mark.parametrize(("kind", "raw"), BAD)
def test_error_names_parameter_value_and_expectation(kind, raw):
    handle = FakeProcess({"/ns/node/a/b": raw}).handle("/ns/node")
    with pytest.raises(ParameterError) as error:
        handle.get_param("~a/b", kind)
    assert str(error.value).startswith(f"parameter /ns/node/a/b is {shown(raw)}; expected {kind}")


def test_error_cuts_a_value_that_is_long():
    handle = FakeProcess({"/node/a": "x" * 200_000}).handle("/node")
    with pytest.raises(ParameterError) as error:
        handle.get_param("~a", FINITE)
    assert str(error.value).startswith("parameter /node/a is 'xxxx")
    assert len(str(error.value)) < 200


@pytest.mark.parametrize(("kind", "text"), EXPECTATIONS)
def test_error_names_a_parameter_that_is_missing(kind, text):
    handle = FakeProcess().handle("/ns/node")
    with pytest.raises(ParameterError) as error:
        handle.get_param("~a/b", kind)
    assert str(error.value) == f"parameter /ns/node/a/b is not set; expected {text}"


def test_a_kind_may_give_its_reason():
    def kind(value):
        raise ValueError("line 3 has letters")

    handle = FakeProcess({"/node/file": "K.txt"}).handle("/node")
    with pytest.raises(ParameterError, match=r"\(line 3 has letters\)$"):
        handle.get_param("~file", kind)


def test_default_counts_only_where_nothing_is_set():
    handle = FakeProcess({"/node/set": 2, "/node/bad": "x"}).handle("/node")
    assert handle.get_param("~set", FINITE, 5.0) == 2.0
    assert handle.get_param("~not_set", FINITE, 5.0) == 5.0
    assert handle.get_param("~optional", TOPIC, None) is None
    with pytest.raises(ParameterError, match="/node/bad"):
        handle.get_param("~bad", FINITE, 5.0)


class Gains(Parameters):
    """Parameters of `Controller`."""

    control_topic: str = topic("control", "controls")
    gains: object = parameter(
        Converted(dict, "a dictionary", "dictionary"), "gains by name", None, "gains"
    )


class Controller(Node[Gains]):
    """A node that reads one more parameter, and sets one."""

    def register_callbacks(self, handle):
        handle.get_param("~limits/tilt", Number(), 0.2)
        handle.set_param("/lqr/child", {"own": 1})


def test_parameters_that_no_node_reads_are_named_in_one_warning():
    process = FakeProcess()
    process.transport.set_param(
        "/lqr",
        {
            "topics": {"control": "u", "contrl": "v"},
            "gains": {"any": 1.0},
            "limits": {"tilt": 0.1},
            "control": {"max_roll": 0.1},
            "fast": True,
        },
    )
    assert process.launch(Controller(), "/lqr")
    (warning,) = process.logged("warn")
    assert warning == (
        "/lqr: parameters that no node reads, and which have no effect: "
        "~topics/contrl (~topics/control?), ~control/max_roll, ~fast"
    )


def test_parameters_that_are_read_are_no_warning():
    process = FakeProcess()
    process.transport.set_param("/lqr", {"topics": {"control": "u"}, "limits": {"tilt": 0.1}})
    assert process.launch(Controller(), "/lqr")
    assert process.logged("warn") == []
