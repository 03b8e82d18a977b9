"""crazyswarm2's motion_capture.yaml."""

import pytest

from crazyflie_fleet.crazyswarm2_files import load_motion_capture
from crazyflie_fleet.mocap_process import make_nodes
from crazyflie_utils import ParameterError
from crazyflie_utils.parameters.types import TEXT as TEXT_TYPE
from crazyflie_utils.parameters.types import Integer
from crazyflie_utils.testing import FakeProcess
from mocap_optitrack.mocap_parameters import MocapParameters

TEXT = """\
/motion_capture_tracking:
  ros__parameters:
    type: "optitrack"
    hostname: "10.0.0.2"
    topics: {poses: {qos: {mode: "none"}}}
    marker_configurations:
      default_single_marker: {offset: [0.0, 0.0, -0.02], points: {p0: [0.0, 0.0, 0.0]}}
    dynamics_configurations:
      default: {max_velocity: [2, 2, 3], max_roll: 1.4}
"""


@pytest.fixture
def load(tmp_path):
    def load(text):
        path = tmp_path / "motion_capture.yaml"
        path.write_text(text)
        return load_motion_capture(path)

    return load


def test_address_and_configurations(load):
    parameters = load(TEXT)
    assert parameters["backend"] == "natnet"
    assert parameters["optitrack_config/server_address"] == "10.0.0.2"
    assert parameters["dynamics_configurations"]["default"]["max_velocity"] == [2, 2, 3]
    assert parameters["marker_configurations"]["default_single_marker"]["offset"][2] == -0.02
    parameters = load(TEXT.replace("optitrack", "vicon"))
    assert parameters["backend"] == "vicon"
    assert parameters["motioncapture_config/hostname"] == "10.0.0.2"


def test_motion_capture_of_a_fleet_takes_them(tmp_path):
    (tmp_path / "motion_capture.yaml").write_text(TEXT)
    (tmp_path / "crazyflies.yaml").write_text("robots: {cf1: {initial_position: [0, 0, 0]}}\n")
    handle = FakeProcess().handle("/mocap_node")
    files = {"file": "crazyflies.yaml", "motion_capture": "motion_capture.yaml"}
    for name, file in files.items():
        handle.set_param(f"/mocap_node/fleet/{name}", str(tmp_path / file))
    handle.set_param("/mocap_node/optitrack_config", {"data_port": 1600})
    make_nodes(handle)
    parameters = handle.load(MocapParameters)
    assert parameters.backend == "natnet"
    config = {
        name: handle.get_param(f"~optitrack_config/{name}", kind)
        for name, kind in (("server_address", TEXT_TYPE), ("data_port", Integer(1, 65535)))
    }
    assert config == {"server_address": "10.0.0.2", "data_port": 1600}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (TEXT.replace("optitrack", "nokov"), ":3. is 'nokov'; expected one of optitrack, "),
        (TEXT.replace('"10.0.0.2"', "[]"), r":4. is \[\]; expected"),
        ("a: {b: 1}\n", "has no ros__parameters of a node; expected crazyswarm2's layout"),
        ("robots: 1\n", "robots is 1; expected a mapping"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(load, text, expected):
    with pytest.raises(ParameterError, match=expected):
        load(text)
