"""Classes of parameters: what they declare, read, and refuse."""

import dataclasses
import math

import pytest

from crazyflie_utils.parameters.command_line import parse_arguments
from crazyflie_utils.parameters.declaration import ParameterError, Parameters, group, parameter
from crazyflie_utils.parameters.types import BOOLEAN, METRES, TOPIC, Integer, Number, Text
from crazyflie_utils.testing import FakeProcess


class AxisParameters(Parameters):
    """Gains of an axis."""

    kp: float = parameter(Number(minimum=0.0), "proportional gain")
    ki: float = parameter(Number(minimum=0.0), "integral gain", default=0.0)


class FlightParameters(Parameters):
    """One of everything."""

    height: float = parameter(METRES, "where to hover", name="hover/z")
    lowest: float = parameter(METRES, "never below this", default=0.0)
    mode: str = parameter(Text(("LQR", "MERGE")), "who decides", default="LQR")
    motors: int = parameter(Integer(1, 4), "how many", default=4)
    noisy: bool = parameter(BOOLEAN, "whether sensors are noisy, 100 %", default=False)
    control_topic: str | None = parameter(TOPIC, "optional", default=None, name="topics/control")
    x: AxisParameters = group(AxisParameters, "PIDs/X")

    def complaints(self):
        """See `Parameters.complaints`."""
        if self.height < self.lowest:
            yield f"hover/z is {self.height:g}; expected at least lowest, {self.lowest:g}"


GOOD = {"hover/z": 1, "PIDs/X/kp": 2.0}


def read(**changes):
    """Return the parameters of GOOD and others."""
    process = FakeProcess({f"/ns/node/{key}": value for key, value in {**GOOD, **changes}.items()})
    return process.handle("/ns/node").load(FlightParameters)


def test_defaults_stand_in_for_what_is_not_set():
    assert read() == FlightParameters(
        height=1.0,
        lowest=0.0,
        mode="LQR",
        motors=4,
        noisy=False,
        control_topic=None,
        x=AxisParameters(kp=2.0, ki=0.0),
    )


def test_what_is_set_counts():
    parameters = read(**{"mode": "MERGE", "PIDs/X/ki": 3, "topics/control": "/control/lqr"})
    assert (parameters.mode, parameters.x.ki) == ("MERGE", 3.0)
    assert parameters.control_topic == "/control/lqr"


def test_parameters_cannot_be_changed_by_accident():
    with pytest.raises(dataclasses.FrozenInstanceError):
        read().height = 2.0


def test_all_that_is_wrong_is_reported_at_once():
    with pytest.raises(ParameterError) as error:
        read(**{"hover/z": "high", "motors": 5, "noisy": 1, "PIDs/X/kp": math.nan})
    assert str(error.value).splitlines() == [
        "parameter /ns/node/hover/z is 'high'; expected a finite number (m)",
        "parameter /ns/node/motors is 5; expected an integer from 1 to 4",
        "parameter /ns/node/noisy is 1; expected true or false",
        "parameter /ns/node/PIDs/X/kp is nan; expected a finite number >= 0",
    ]


def test_what_is_missing_is_said_too():
    with pytest.raises(ParameterError) as error:
        FakeProcess().handle("/node").load(FlightParameters)
    assert [line.split(";")[0] for line in str(error.value).splitlines()] == [
        "parameter /node/hover/z is not set",
        "parameter /node/PIDs/X/kp is not set",
    ]


def test_values_that_do_not_fit_together():
    with pytest.raises(ParameterError, match="hover/z is 1; expected at least lowest, 2"):
        read(lowest=2.0)


def test_declarations_have_full_names():
    declarations = list(FlightParameters.declarations())
    assert [declaration.name for declaration in declarations] == [
        "hover/z",
        "lowest",
        "mode",
        "motors",
        "noisy",
        "topics/control",
        "PIDs/X/kp",
        "PIDs/X/ki",
    ]
    assert declarations[3].help == "how many"


def test_a_namespace_that_is_a_value_hides_no_error():
    with pytest.raises(ParameterError, match="/node/hover/z is not set"):
        FakeProcess({"/node/hover": 3.0, "/node/PIDs/X/kp": 1.0}).handle("/node").load(
            FlightParameters
        )


# From a mapping.


def test_from_a_mapping():
    assert FlightParameters.from_mapping(GOOD) == read()


def test_unknown_names_in_a_mapping_are_reported_with_the_rest():
    with pytest.raises(ParameterError) as error:
        FlightParameters.from_mapping({"hight": 1.0, "PIDs/X/kp": 2.0}, "bodies/7/")
    first, second = str(error.value).splitlines()
    assert first.startswith(
        "bodies/7/hight is not a parameter; expected one of PIDs/X/ki, PIDs/X/kp"
    )
    assert second == "parameter bodies/7/hover/z is not set; expected a finite number (m)"


class NamedAxis(AxisParameters):
    """Gains, and whose they are."""

    name: str = ""


def test_a_field_that_is_not_declared_is_no_parameter():
    assert [each.name for each in NamedAxis.declarations()] == ["kp", "ki"]
    axis = dataclasses.replace(NamedAxis.from_mapping({"kp": 2.0}), name="x")
    assert (axis.name, axis.kp) == ("x", 2.0)
    with pytest.raises(ParameterError, match="name is not a parameter"):
        NamedAxis.from_mapping({"kp": 2.0, "name": "x"})


# From a command line.


def parse(*arguments):
    """Return the parameters on a command line."""
    return parse_arguments(FlightParameters, list(arguments), "fly", "Flies.")


def test_from_a_command_line():
    given = ["--hover-z", "1", "--PIDs-X-kp=2", "--noisy", "True", "--motors", "0x2"]
    assert parse(*given) == read(noisy=True, motors=2)


def test_all_that_is_wrong_with_a_command_line_is_reported(capsys):
    with pytest.raises(SystemExit) as end:
        parse("--hover-z", "high", "--noisy", "perhaps", "--motors", "9")
    assert end.value.code == 2
    said = capsys.readouterr().err
    for text in (
        "--hover-z is 'high'; expected a finite number (m)",
        "--noisy is 'perhaps'; expected true or false",
        "--motors is '9'; expected an integer from 1 to 4",
        "--PIDs-X-kp is not set",
    ):
        assert text in said


@pytest.mark.parametrize("text", ["1_000", "1e", "-", "1,5", "0x1p3", "1__0", "١"])
def test_a_word_that_only_python_takes_for_a_number_is_refused(capsys, text):
    with pytest.raises(SystemExit):
        parse(f"--hover-z={text}", "--PIDs-X-kp=2", f"--motors={text}")
    said = capsys.readouterr().err
    assert f"--hover-z is {text!r}; expected a finite number (m)" in said
    if text != "١":
        assert f"--motors is {text!r}; expected an integer from 1 to 4" in said


@pytest.mark.parametrize("text", ["1", "7.", ".5", "+2.5e-3", "1E5", " 7 "])
def test_a_number_on_a_command_line(text):
    assert parse(f"--hover-z={text}", "--PIDs-X-kp=2").height == float(text)


def test_help_says_unit_and_default(capsys):
    with pytest.raises(SystemExit):
        parse("--help")
    said = " ".join(capsys.readouterr().out.split())
    assert "--hover-z FLOAT where to hover, m" in said
    assert "whether sensors are noisy, 100 % (default: False)" in said
