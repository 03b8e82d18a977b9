"""crazyswarm2's server.yaml."""

import pytest

from crazyflie_driver.driver_parameters import CrazyflieServerParameters
from crazyflie_fleet import driver_process, mocap_process
from crazyflie_utils import ParameterError
from crazyflie_utils.testing import FakeProcess
from mocap_optitrack.mocap_parameters import MocapParameters

SERVER = """\
/crazyflie_server:
  ros__parameters:
    warnings:
      frequency: 1.0
      motion_capture: {warning_if_rate_outside: [80.0, 120.0]}
      communication:
        max_unicast_latency: 12.5
        min_unicast_ack_rate: 0.9
        min_unicast_receive_rate: 0.7
        min_broadcast_receive_rate: 0.6
        publish_stats: false
    firmware_params: {query_all_values_on_connect: False}
    sim: {backend: np, visualizations: {rviz: {enabled: true}}}
    colour: red
"""
FLEET = """\
robots: {cf1: {initial_position: [0, 0, 0]}}
all: {broadcasts: {num_repeats: 15, delay_between_repeats_ms: 2}}
"""


@pytest.fixture
def made(tmp_path):
    """Return a function that makes a process, and returns its handle and warnings."""

    def make(make_nodes, server=SERVER):
        (tmp_path / "server.yaml").write_text(server)
        (tmp_path / "crazyflies.yaml").write_text(FLEET)
        process = FakeProcess()
        handle = process.handle("/node")
        handle.set_param("/node/fleet/file", str(tmp_path / "crazyflies.yaml"))
        handle.set_param("/node/fleet/server", str(tmp_path / "server.yaml"))
        make_nodes(handle)
        return process, handle

    return make


def test_the_driver_warns_outside_its_limits(made):
    process, handle = made(driver_process.make_nodes)
    parameters = handle.load(CrazyflieServerParameters)
    link, broadcast = parameters.link, parameters.broadcast
    assert (link.max_latency, link.min_quality) == (0.0125, 0.9)
    assert (link.min_unicast_rate, link.min_broadcast_rate) == (0.7, 0.6)
    assert (broadcast.repeats, broadcast.repeat_period, broadcast.poses) == (15, 0.002, 5)
    remarks = [text.partition("server.yaml: ")[2] for text in process.logged("warn")]
    assert remarks == [
        "ignored, since they are not known here: colour (line 14)",
        "warnings/frequency (line 4) has no effect here",
        "warnings/communication/publish_stats (line 11) has no effect here",
        "firmware_params (line 12) has no effect here",
        "sim (line 13) has no effect here",
    ]


def test_motion_capture_warns_outside_its_rate(made):
    _, handle = made(mocap_process.make_nodes)
    assert handle.load(MocapParameters).rate_limits == (80.0, 120.0)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("min_unicast_ack_rate: 0.9", "min_unicast_ack_rate: 90", ":8. is 90; expected a "),
        ("[80.0, 120.0]", "[80.0]", r":5. is \[80.0\]; expected a list of 2"),
        ("min_unicast_ack_rate", "min_unicast_ack_rat", ":8: .* is not known; expected min_unic"),
        ("ros__parameters", "parameters", "has no ros__parameters of a node; expected crazysw"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(made, old, new, expected):
    with pytest.raises(ParameterError, match=expected):
        made(driver_process.make_nodes, SERVER.replace(old, new))


def test_a_misspelt_name_does_not_hide_other_errors(made):
    wrong = SERVER.replace("[80.0, 120.0]", "[80.0]").replace("_ack_rate", "_ack_rat")
    with pytest.raises(ParameterError) as error:
        made(driver_process.make_nodes, wrong)
    assert len(error.value.complaints) == 2
