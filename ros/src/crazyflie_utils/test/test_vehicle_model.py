"""Models of vehicles: types, and files with the figures of one."""

import math

import pytest

from crazyflie_model.quadrotor import CRAZYFLIE, TYPES
from crazyflie_utils import ParameterError
from crazyflie_utils.parameters import model_file, vehicle_model


def written(tmp_path, text):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    return str(path)


def test_figures_of_a_file_override_those_of_its_type(tmp_path):
    text = "type: cf21plus\nmass: 0.0345\nlag: {roll: 0.08}\ntrim: {pitch: -0.02}\ndelay: 0.03\n"
    model = vehicle_model.load(written(tmp_path, text))
    assert (model.mass, model.roll_lag, model.pitch_lag) == (0.0345, 0.08, None)
    assert (model.pitch_trim, model.delay) == (-0.02, 0.03)
    assert model.thrust_linear == TYPES["cf21plus"].thrust_linear
    assert vehicle_model.load("cf21") == CRAZYFLIE


@pytest.mark.parametrize("name", TYPES)
def test_every_type_hovers_well_below_full_command(name):
    model = TYPES[name]
    hover = model.pwm(9.81)
    assert 25000.0 < hover <= 42000.1
    assert model.thrust(hover) == pytest.approx(9.81)
    # The speed that the command asks for carries the vehicle.
    speed = model.rotor_speed(hover)
    assert 4.0 * model.thrust_constant * speed**2 == pytest.approx(9.81 * model.mass)
    assert model.rotor_speed(65535.0) <= model.max_rotor_speed * (1.0 + 1e-9)


def test_the_published_curve_carries_33_g_at_the_links_hover():
    assert TYPES["cf21_markers"].thrust(42000.0) == pytest.approx(9.81, rel=0.005)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            "mass: 33\n",
            r"mass .*mine.yaml:1\) is 33; expected a finite number >= 0.005 and <= 2 \(kg",
        ),
        (
            "mass: 0.033\nthrust_curve: [0.1]\n",
            r"thrust_curve .*:2\) is \[0.1\]; expected a list of 2",
        ),
        ("thrust_curve: [0.2, -0.15]\n", "expected one that rises"),
        # At full command its thrust is negative, so that no speed of the rotors makes it.
        (
            "thrust_curve: [0.2, -0.3]\n",
            r"mine.yaml:1: .*is \[0.2, -0.3\]; expected one that rises",
        ),
        ("mass: 0.06\n", "mass is 0.06 kg, and the rotors lift 0.64 times the weight"),
        ("masss: 0.03\n", "masss is not known; expected one of .*mass"),
        ("type: cf3\n", "type .* is 'cf3'; expected one of cf21,"),
        ("trim: {roll: 2.0}\n", "trim/roll .* is 2.0; expected a finite number >= -0.2"),
    ],
)
def test_what_is_wrong_is_named_with_its_line_and_what_was_expected(tmp_path, text, complaint):
    with pytest.raises(ParameterError, match=complaint):
        vehicle_model.load(written(tmp_path, text))


def test_a_type_without_published_figures_says_so():
    with pytest.raises(
        ParameterError, match="model bolt does not exist: a Bolt has .*expected one of cf21,"
    ):
        vehicle_model.load("bolt")
    with pytest.raises(ParameterError, match="the model cf5 does not exist; expected one of cf21,"):
        vehicle_model.load("cf5")
    with pytest.raises(ValueError, match="nothing.yaml"):
        vehicle_model.VEHICLE_MODEL("nothing.yaml")


def test_what_is_saved_is_what_is_read(tmp_path):
    path = tmp_path / "model.yaml"
    text = "mass: 0.03\nlag: {roll: 0.1, pitch: 0.11, yaw: 0.09}\ntrim: {roll: 0.01}\n"
    model = vehicle_model.load(written(tmp_path, text))
    model_file.save(path, "cf21", model, {"bag": "flight.bag"})
    loaded = vehicle_model.load(str(path))
    assert (loaded.yaw_lag, loaded.roll_trim, loaded.mass) == (0.09, 0.01, 0.03)
    assert math.isclose(loaded.pwm(9.81), model.pwm(9.81))


def test_a_hover_that_was_measured_is_that_of_the_file(tmp_path):
    own = written(tmp_path, "type: cf21_markers\nmass: 0.035\ninertia_x: 1.5e-5\n")
    path = tmp_path / "measured.yaml"
    for model, pwm in ((own, 39000.0), ("brushless", 31000.0)):
        model_file.save_with_hover(path, model, pwm)
        measured, before = vehicle_model.load(str(path)), vehicle_model.load(model)
        assert measured.thrust(pwm) == pytest.approx(9.81)
        assert (measured.mass, measured.inertia_x) == (before.mass, before.inertia_x)
