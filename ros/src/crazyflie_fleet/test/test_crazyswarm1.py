"""Crazyswarm 1's two files as a fleet."""

import pytest

from crazyflie_fleet import fleet_file
from crazyflie_utils import ParameterError

VEHICLES = """\
crazyflies:
  - id: 1
    channel: 100
    initialPosition: [1.5, 1.0, 0.0]
    type: default
  - id: 26
    channel: 80
    initialPosition: [0, 0, 0]
    type: single
"""
TYPES = """\
crazyflieTypes:
  default: &default
    bigQuad: False
    batteryVoltageWarning: 3.8
    batteryVoltateCritical: 3.7
    markerConfiguration: 0
    dynamicsConfiguration: 0
    firmwareParams:
      ctrlMel: {kp_xy: 0.4}
  single:
    markerConfiguration: 3
numMarkerConfigurations: 2
markerConfigurations:
  "0": {numPoints: 2, offset: [0, 0, 0], points: {"0": [0, 0, 0], "1": [0, 0, 1]}}
  "3": {numPoints: 1, offset: [0, 0, 0], points: {"0": [0, 0, 0]}}
"""


@pytest.fixture
def load(tmp_path):
    def load(vehicles=VEHICLES, types=TYPES):
        path = tmp_path / "crazyflies.yaml"
        path.write_text(vehicles)
        if types:
            (tmp_path / "crazyflieTypes.yaml").write_text(types)
        return fleet_file.load(path)

    return load


def test_names_and_addresses_follow_from_ids(load):
    fleet = load()
    assert {vehicle.name: vehicle.uri for vehicle in fleet.vehicles} == {
        "cf1": "radio://0/100/2M/E7E7E7E701",
        "cf26": "radio://0/80/2M/E7E7E7E71A",
    }
    assert fleet["cf1"].position == (1.5, 1.0, 0.0)


def test_types_are_those_of_the_file_beside_it(load):
    fleet = load()
    first, second = (fleet[name] for name in ("cf1", "cf26"))
    assert (first.voltage_warning, first.voltage_critical) == (3.8, 3.7)
    assert fleet["cf1"].firmware_params == {"ctrlMel.kp_xy": 0.4}
    assert (first.mocap_marker, first.mocap_tracking) == ("0", "vendor")
    assert (second.mocap_marker, second.mocap_tracking) == ("3", "single_marker")


@pytest.mark.parametrize("from_text", [True, False])
def test_without_that_file_types_have_no_effect(load, from_text):
    fleet = fleet_file.parse(VEHICLES) if from_text else load(types="")
    assert fleet.names == ("cf1", "cf26")
    (remark,) = fleet.warnings
    assert remark.endswith("there is no crazyflieTypes.yaml next to it; types have no effect")


@pytest.mark.parametrize(
    ("vehicles", "types", "text"),
    [
        (
            VEHICLES.replace("26", "1"),
            TYPES,
            "crazyflies.1./id is also that of cf1 in line 2",
        ),
        (VEHICLES.replace("26", "256"), TYPES, "crazyflies.1./id is 256; expected an integer fro"),
        (VEHICLES.replace("80", "x"), TYPES, ":7: crazyflies.1./channel is 'x'; expected an integ"),
        (VEHICLES.replace("single", "none"), TYPES, "type is 'none'; expected one of default, sin"),
        ("crazyflies: {}", TYPES, "crazyflies is {}; expected a list"),
        ("crazyflies: []", TYPES, "has no enabled vehicle"),
        (VEHICLES, TYPES.replace("3.8", "much"), "Types.yaml:4. is 'much'; expected a finite num"),
        (VEHICLES, TYPES.replace("3.8", "3.5"), "crazyflieTypes.yaml:5: battery/voltage_critical"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(load, vehicles, types, text):
    with pytest.raises(ParameterError, match=text):
        load(vehicles, types)


def test_a_vehicle_without_a_channel_has_no_address(load):
    fleet = load(VEHICLES.replace("    channel: 80\n", ""))
    assert fleet["cf1"].uri is not None and fleet["cf26"].uri is None
