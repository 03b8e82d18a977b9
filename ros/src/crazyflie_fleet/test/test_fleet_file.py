"""Fleet files: what is read, what is inherited, what is refused, and where messages point."""

import math
from pathlib import Path

import numpy as np
import pytest
import rospkg
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_fleet import fleet_file
from crazyflie_fleet.connect_node import lighthouse_file
from crazyflie_fleet.fleet_config import LogTopicSettings
from crazyflie_fleet.fleet_parameters import FleetParameters
from crazyflie_fleet.launch_text import launch_text
from crazyflie_fleet.vehicle_nodes import parameters
from crazyflie_utils import ParameterError
from crazyflie_utils.testing import FakeProcess

EXAMPLE = Path(rospkg.RosPack().get_path("crazyflie_fleet")) / "config" / "example.yaml"

TWO = """\
robots:
  cf1:
    uri: radio://0/80/2M/E7E7E7E701
    initial_position: [0, 0, 0]
  cf2:
    uri: radio://0/80/2M/E7E7E7E702
    initial_position: [0, 1, 0]
"""


@pytest.fixture
def load(tmp_path):
    def load(text):
        path = tmp_path / "fleet.yaml"
        path.write_text(text)
        return fleet_file.load(path)

    return load


def complaints_of(load, text):
    with pytest.raises(ParameterError) as caught:
        load(text)
    return [text.partition("fleet.yaml")[2] for text in caught.value.complaints]


def test_the_example():
    fleet = fleet_file.load(EXAMPLE)
    assert fleet.names == ("cf1", "cf2")
    assert fleet.disabled == ("cf3",)
    second = fleet["cf2"]
    assert second.position == (0.0, 1.0, 0.0)
    assert second.hover_point == (0.0, 1.0, 1.0)
    assert second.uri == "radio://0/80/2M/E7E7E7E702"
    assert second.mocap_frame == "cf2"
    assert second.firmware_params["locSrv.extPosStdDev"] == 0.001
    motors = {"frequency": 10.0, "vars": ["motor.m1", "motor.m2", "motor.m3", "motor.m4"]}
    assert second.log_topics == {"motors": LogTopicSettings.from_mapping(motors)}
    assert second.default_topics == ("battery", "pose")
    assert fleet["cf1"].log_topics == {}
    assert fleet.warnings == ()


def test_the_nearest_one_counts(load):
    fleet = load(
        TWO
        + "    type: big\n    firmware_params: {a: {x: 3}}\n"
        + "robot_types:\n  big: {buffer: 0.4, hover_height: 2, firmware_params: "
        + "{a: {x: 2, y: 2}}}\n"
        + "all: {buffer: 0.1, firmware_params: {a: {x: 1, y: 1, z: 1}}}\n"
    )
    assert [vehicle.buffer for vehicle in fleet.vehicles] == [0.1, 0.4]
    assert fleet["cf1"].firmware_params == {"a.x": 1, "a.y": 1, "a.z": 1}
    assert fleet["cf2"].firmware_params == {"a.x": 3, "a.y": 2, "a.z": 1}
    assert fleet["cf2"].hover_height == 2.0


def remarks_of(load, text):
    return [remark.partition("fleet.yaml")[2] for remark in load(text).warnings]


def test_what_has_no_effect_is_remarked_once_a_key(load):
    logging = "all:\n  broadcasts: {num_repeats: 15}\n  firmware_logging:\n    default_topics:\n"
    text = TWO + logging + "      odom: {frequency: 10}\n      status: {frequency: 1}\n"
    assert remarks_of(load, text.replace("[0, 1, 0]", "[0, 1, 0]\n    big_quad: false")) == [
        ":13: all/firmware_logging/default_topics/odom is not offered by the driver, and is "
        "ignored",
        ": frequency of a default topic (line 14) has no effect here",
        ": big_quad (line 8) has no effect here",
    ]
    assert load(text).broadcasts == {"broadcast/repeats": 15, "broadcast/repeat_period": 0.001}
    assert load(text)["cf1"].default_topics == ("battery",)


def test_private_keys_are_passed_over_with_one_remark(load):
    text = TWO.replace("[0, 1, 0]", "[0, 1, 0]\n    role: pursuer\n    colour: red")
    text += "    group: {of: [mine]}\nrelative: false\nall: {role: none, battery: {cells: 1}}\n"
    (remark,) = remarks_of(load, text)
    assert remark == (
        ": ignored, since they are not known here: relative (line 11); role (line 12, 8); "
        "cells (line 12); colour (line 9); group (line 10)"
    )


def test_start_points_that_are_close_are_remarked(load):
    fleet = load(TWO.replace("[0, 1, 0]", "[0, 0.2, 0]"))
    assert fleet.unplaced == (("cf1", "cf2"),)
    (warning,) = fleet.warnings
    assert warning.endswith(
        "fleet.yaml: the start points of cf1 and cf2 are 0.2 m apart, and their collision buffers "
        "need 0.3 m; neither takes off until they are measured that far apart"
    )
    assert load(TWO).unplaced == ()


@pytest.mark.parametrize(("act", "limits"), [("", (3.2, 3.0)), (", act: true", (3.8, 3.7))])
def test_voltages_act_if_they_are_said_to(load, act, limits):
    text = f"all: {{battery: {{voltage_warning: 3.8, voltage_critical: 3.7{act}}}}}\n"
    vehicle = load(TWO + text)["cf1"]
    assert vehicle.battery_limits == limits
    assert vehicle.voltage_warning == 3.8


def test_what_a_type_and_all_say_counts_for_their_vehicles(load):
    text = "robots: {a: {type: x, uri: usb://0}}\nrobot_types: {x: {initial_position: [1, 2, 0]}}\n"
    assert load(text)["a"].position == (1.0, 2.0, 0.0)


def test_a_text_in_place_of_a_file():
    assert fleet_file.parse(TWO).names == ("cf1", "cf2")
    with pytest.raises(ParameterError, match="crazyflies.yaml:1: the file has neither robots"):
        fleet_file.parse("a: 1")
    with pytest.raises(ParameterError, match="lab.yaml: is empty; expected a mapping"):
        fleet_file.parse("", "lab.yaml")


def test_logging_may_be_off(load):
    off = "all: {firmware_logging: {enabled: false, default_topics: {imu: {}}}}\n"
    assert load(TWO + off)["cf1"].default_topics == ("battery",)


def test_simulated_vehicles_need_no_address(load):
    assert load("robots: {a: {initial_position: [0, 0, 0]}}\n")["a"].uri is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            TWO.replace("cf2", "cf1"),
            ":6: robots/cf1 occurs twice, first in line 3",
        ),
        (
            TWO.replace("radio://0/80/2M/E7E7E7E701", "udp://a:1").replace(
                "radio://0/80/2M/E7E7E7E702", "udp://a:1"
            ),
            ":6: robots/cf2/uri is udp://a:1, which is also that of cf1 in line 3; expected an ",
        ),
        (
            TWO + "all: {motion_capture: {frame: body}}\n",
            ":6: robots/cf2 has the frame body of motion capture, which is that of cf1; expected a "
            "frame of its own",
        ),
        (
            TWO + "    motion_capture: {frame: /cf1}\n",
            ":8: robots/cf2/motion_capture/frame has the frame cf1 of motion capture, which is ",
        ),
        (
            TWO.replace("0, 0, 0]", "0, 0, 0]\n    motion_capture: {frame: cf2}"),
            ":5: robots/cf1/motion_capture/frame has the frame cf2 of motion capture, which is ",
        ),
        (
            TWO + "    type: cf21\n",
            ":8: robots/cf2/type is 'cf21'; expected none, as there are no types",
        ),
        (
            TWO + "    type: b\nrobot_types: {a: {}}\n",
            ":8: robots/cf2/type is 'b'; expected one of a",
        ),
        (TWO + "robot_typs: {}\n", ":8: robot_typs is not known; expected robot_types"),
        (TWO + "all: {buffer: 0}\n", ":8) is 0; expected a finite number > 0 (m)"),
        (TWO + "all: {bufer: 1}\n", ":8: all/bufer is not known; expected buffer"),
        (
            TWO + "all: {firmware_params: {a: {b: much}}}\n",
            ":8: all/firmware_params/a/b is 'much'; expected a finite number",
        ),
        (
            TWO + "all: {firmware_params: {health: {startPropTest: 1}}}\n",
            ":8: all/firmware_params/health/startPropTest turns motors, arms, stops or restarts "
            "the vehicle, and is not a setting; expected none",
        ),
        (
            TWO + "    firmware_params: {motorPowerSet: {enable: 1}}\n",
            ":8: robots/cf2/firmware_params/motorPowerSet/enable turns motors, arms, stops or ",
        ),
        (
            TWO + "all: {firmware_params: {a: 3}}\n",
            ":8: all/firmware_params/a is 3; expected a mapping",
        ),
        (
            TWO + "all: {firmware_logging: {custom_topics: {a: {frequency: 1000, vars: [b.c]}}}}\n",
            ":8) is 1000; expected a finite number >= 0.4 and <= 100 (Hz)",
        ),
        (TWO.replace("cf2", "all"), ":6: robots/all is 'all'; expected letters, digits and "),
        (TWO.replace("cf2", "cf-2"), ":6: robots/cf-2 is 'cf-2'; expected letters, digits and "),
        (
            TWO.replace("80/2M", "80/3M", 1),
            ":3) is 'radio://0/80/3M/E7E7E7E701'; expected radio://DONGLE/CHANNEL/RATE/ADDRESS",
        ),
        (TWO + "    enabled: maybe\n", ":8) is 'maybe'; expected true or false"),
        (TWO + "    initial_position: [0, 1]\n", ":8: robots/cf2/initial_position occurs twice"),
        (
            "robots: {a: {}}\n",
            ":1) is not set; expected a list of 3, each entry a finite number (m)",
        ),
        (
            TWO.replace("[0, 1, 0]", "[0, 1, -1]"),
            ":7) is [0, 1, -1]; expected a list of 3, each entry a finite number (m), z at least 0 "
            "(z is -1, below the ground)",
        ),
        (
            TWO.replace("[0, 1, 0]", "[0, 1, -0.001]\n    enabled: false"),
            ":7) is [0, 1, -0.001]; expected a list of 3",
        ),
        (
            "robots: {a: {enabled: false, initial_position: [0, 0, 0]}}\n",
            ":1: robots has no enabled vehicle",
        ),
        (
            TWO + "all: {battery: {voltage_critical: 3.5}}\n",
            ":8: battery/voltage_critical is 3.5; expected not more than voltage_warning, 3.2 (V)",
        ),
        (
            TWO + "    battery: {voltage_warning: 2.9}\n",
            ":8: battery/voltage_warning is 2.9; expected not less than voltage_critical, 3 (V)",
        ),
        (TWO + "    machine: far\n", ":8: robots/cf2/machine is 'far'; expected one of local"),
        (
            "cf1: {}\n",
            ":1: the file has neither robots (crazyswarm2) nor crazyflies (Crazyswarm 1); "
            "it has cf1",
        ),
    ],
)
def test_what_is_wrong_is_named_with_its_line(load, text, expected):
    assert complaints_of(load, text)[0].startswith(expected)


SIX = ", ".join(f"stateEstimate.{axis}" for axis in ("x", "y", "z", "vx", "vy", "vz"))


@pytest.mark.parametrize(
    ("variables", "size"),
    # A variable of another firmware has a byte at least.
    [(SIX + ", radio.rssi, my.own", 26), (SIX + ", pm.vbat", 28), (SIX + ", a.a, a.b, a.c", 27)],
)
def test_a_topic_that_exceeds_a_packet_is_refused_with_its_line(load, variables, size):
    topics = f"{{estimate: {{frequency: 10,\n vars: [{variables}]}}}}"
    text = TWO + f"    firmware_logging: {{custom_topics: {topics}}}\n"
    if size <= 26:
        assert list(load(text)["cf2"].log_topics) == ["estimate"]
        return
    assert complaints_of(load, text) == [
        f":9: robots/cf2/firmware_logging/custom_topics/estimate/vars takes {size} bytes or more; "
        "at most 26 fit in a packet: make it two topics"
    ]


def test_vehicles_may_merge_what_they_have_in_common(load):
    fleet = load("""\
defaults: &cf
  enabled: true
  type: cf21
  initial_position: [0, 0, 0]
robots:
  cf1:
    <<: *cf
    uri: radio://0/80/2M/E7E7E7E701
  cf2:
    <<: *cf
    uri: radio://0/80/2M/E7E7E7E702
    initial_position: [1, 0, 0]
robot_types:
  cf21: {big_quad: false}
""")
    assert fleet.names == ("cf1", "cf2")
    assert fleet["cf2"].position == (1.0, 0.0, 0.0)
    assert not any("defaults" in text for text in fleet.warnings)


def test_an_empty_path_is_no_file():
    with pytest.raises(ParameterError, match="cannot be read: Is a directory"):
        fleet_file.load("")


def test_files_are_found_from_home(tmp_path, monkeypatch):
    """A fleet file, and those that it names."""
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "heavy.yaml").write_text("mass: 0.035\n")
    (tmp_path / "stations.yaml").write_text("")
    text = TWO.replace("uri", "model: ~/heavy.yaml\n    lighthouse: ~/stations.yaml\n    uri", 1)
    (tmp_path / "fleet.yaml").write_text(text)
    fleet = fleet_file.load("~/fleet.yaml")
    assert fleet["cf1"].model == str(tmp_path / "heavy.yaml")
    assert lighthouse_file("~/fleet.yaml", fleet["cf1"]) == str(tmp_path / "stations.yaml")
    handle = FakeProcess({"/fleet": {"fleet": {"file": "~/fleet.yaml"}}}).handle("/fleet")
    assert handle.load(FleetParameters).fleet().names == ("cf1", "cf2")
    assert f'value="{tmp_path}/fleet.yaml"' in launch_text("~/fleet.yaml")


def test_numbers_are_written_as_people_do(load):
    fleet = load("""\
robots:
  cf1:
    uri: radio://0/80/2M/e7e7e7e701
    initial_position: [0, '0', 1e-3]
    type: cf21
    buffer: 2e-1
    firmware_params:
      kalman: {pNAcc_xy: .5, pNAcc_z: 1.}
      ring: {effect: 0x07, headlightEnable: true, glowstep: 010}
robot_types:
  cf21: {battery: {voltage_warning: 38e-1, voltage_critical: 3.7}}
""")
    vehicle = fleet["cf1"]
    assert vehicle.position == (0.0, 0.0, 0.001)
    assert (vehicle.buffer, vehicle.voltage_warning) == (0.2, 3.8)
    params = vehicle.firmware_params
    assert (params["kalman.pNAcc_xy"], params["kalman.pNAcc_z"]) == (0.5, 1.0)
    assert (params["ring.effect"], params["ring.headlightEnable"]) == (7, 1)
    assert params["ring.glowstep"] == 10


@pytest.mark.parametrize("value", ["'1_0'", "1e400", "nan", "0x" + "f" * 4000, "[1]", "'٣'"])
def test_firmware_parameters_are_finite_numbers(load, value):
    text = TWO + f"all: {{firmware_params: {{a: {{b: {value}}}}}}}\n"
    (found,) = complaints_of(load, text)
    assert found.startswith(":8: all/firmware_params/a/b is ")
    assert found.endswith("; expected a finite number")


def test_messages_cut_what_is_long(load):
    long = "x" * 200_000
    for text in (
        TWO.replace("cf2", f"? {long}-\n  "),
        TWO + f"    machine: {long}\n",
        TWO + f"    type: {long}\nrobot_types: {{? {long}y\n : {{}}}}\n",
        TWO + f"all: {{firmware_params: {{a: {{b: {long}}}}}}}\n",
    ):
        assert max(map(len, complaints_of(load, text))) < 700


def test_aliases_within_themselves_are_refused(load):
    (found,) = complaints_of(load, "robots: &a\n  cf1: {initial_position: [0, 0, 0], more: *a}\n")
    assert found == ":2: has the alias *a within the node to which it refers"


def test_what_is_inherited_is_wrong_once(load):
    assert len(complaints_of(load, TWO + "all: {buffer: -1, model: box}\n")) == 2


@pytest.mark.parametrize(
    "types",
    [
        "    type: big\nrobot_types: {big: {battery: {voltage_warning: 3.6}}}\n",
        "    type: big\nrobot_types: {big: {}}\nall: {battery: {voltage_warning: 3.6}}\n",
    ],
)
def test_voltages_are_compared_as_they_count_together(load, types):
    fleet = load(TWO + "    battery: {voltage_critical: 3.4}\n" + types)
    settings = fleet["cf2"]
    assert (settings.voltage_warning, settings.voltage_critical) == (3.6, 3.4)


def test_voltages_of_a_type_and_of_its_vehicle_do_not_fit(load):
    text = TWO + "    type: big\n    battery: {voltage_warning: 3.3}\n"
    text += "robot_types: {big: {battery: {voltage_critical: 3.4, voltage_warning: 3.6}}}\n"
    assert complaints_of(load, text) == [
        ":10: battery/voltage_critical is 3.4; expected not more than voltage_warning, 3.3 (V)"
    ]


def test_disabled_vehicles_may_be_anywhere(load):
    assert load(TWO.replace("[0, 1, 0]", "[0, 0, 0]\n    enabled: false")).names == ("cf1",)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("radio://0/80/2M/E7E7E7E701", "radio://1/80/2M/e7e7e7e701"),
        ("radio://*/80/2M/E7E7E7E701", "radio://0/080/2M/E7E7E7E701?safelink=0"),
        ("radio://0/80/2M", "radio://0/80/2M/E7E7E7E7E7"),
        ("udp://127.0.0.1:19850", "udp://localhost:19850"),
    ],
)
def test_two_spellings_of_one_address_are_one_vehicle(load, first, second):
    text = TWO.replace("radio://0/80/2M/E7E7E7E701", first)
    (found,) = complaints_of(load, text.replace("radio://0/80/2M/E7E7E7E702", second))
    assert found.startswith(f":6: robots/cf2/uri is {second}, which is also that of cf1 in line 3")


@pytest.mark.parametrize(
    "uri", ["radio://0/126/2M/E7E7E7E701", "udp://127.0.0.1:65536", "radio://0/80/3M", "usb://x"]
)
def test_an_address_that_the_driver_would_refuse_is_refused(load, uri):
    (found,) = complaints_of(load, TWO.replace("radio://0/80/2M/E7E7E7E702", uri))
    assert f":6) is '{uri}'; expected radio://DONGLE/CHANNEL" in found


@given(st.integers(1, 120))
def test_a_grid(n):
    fleet = fleet_file.grid(n)
    assert len(set(fleet.names)) == len({vehicle.uri for vehicle in fleet.vehicles}) == n
    places = np.array([vehicle.position for vehicle in fleet.vehicles])
    assert len({*map(tuple, places)}) == n
    assert np.abs(places).max() <= math.sqrt(n) / 2 + 0.5


@pytest.mark.parametrize(
    ("arguments", "text"), [((0,), "at least one"), ((9, 0.2), "grid is 0.2 m; expected")]
)
def test_no_grid(arguments, text):
    with pytest.raises(ParameterError, match=text):
        fleet_file.grid(*arguments)


def test_a_model_file_is_relative_to_the_fleet_file(tmp_path):
    (tmp_path / "heavy.yaml").write_text("type: cf21_markers\nmass: 0.045\n")
    file = tmp_path / "fleet.yaml"
    text = (
        "robots: {a: {initial_position: [0, 0, 0], type: heavy},\n"
        " b: {initial_position: [1, 0, 0], model: cf21plus}, c: {initial_position: [2, 0, 0]}}\n"
        "robot_types: {heavy: {model: heavy.yaml}}\n"
    )
    file.write_text(text)
    fleet = fleet_file.load(file)
    found = [(v.dynamics, v.vehicle_model) for v in fleet.vehicles]
    heavy = str(tmp_path / "heavy.yaml")
    assert found == [("quadrotor", heavy), ("quadrotor", "cf21plus"), ("coupled_7d", "cf21")]
    tree = parameters(fleet["a"], {}, {"lqr_controller": {"K_file": "K_manual.txt"}})
    assert tree["cmd_vel_converter"]["model"] == tree["simulator"]["model"] == heavy
    assert tree["lqr_controller"]["K_file"] == heavy
    tree = parameters(fleet["c"], {}, {"lqr_controller": {"K_file": "K_manual.txt"}})
    assert tree["lqr_controller"]["K_file"] == "K_manual.txt"


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        ("grams.yaml", r"fleet.yaml:1: robots/a/model .*grams.yaml:1.* is 33; expected a finite"),
        ("none.yaml", r"fleet.yaml:1: robots/a/model .*none.yaml"),
        ("bolt", r"robots/a/model .*is 'bolt'; expected one of near_hover.*a Bolt has"),
    ],
)
def test_an_invalid_model_is_named_with_its_line(tmp_path, model, expected):
    (tmp_path / "grams.yaml").write_text("mass: 33\n")
    file = tmp_path / "fleet.yaml"
    file.write_text(f"robots: {{a: {{initial_position: [0, 0, 0], model: {model}}}}}\n")
    with pytest.raises(ParameterError, match=expected):
        fleet_file.load(file)
