"""The node that has the server add a vehicle."""

from concurrent.futures import Future
from pathlib import Path

import pytest
from roslaunch.config import load_config_default

from crazyflie_driver.add_node import CrazyflieAddNode
from crazyflie_driver.srv import (
    AddCrazyflie,
    AddCrazyflieResponse,
    UpdateParams,
    UpdateParamsResponse,
)
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess

PARAMETERS = {"uri": "udp://127.0.0.1:19850", "tf_prefix": "cf1"}


class Launch:
    """A server that keeps requests, and the node."""

    def __init__(self, parameters, refusal=None, answer=None):
        self.requests = []
        self.process = FakeProcess()

        def serve(request):
            self.requests.append(request)
            if refusal is not None:
                raise ServiceError(refusal)
            return AddCrazyflieResponse() if answer is None else answer

        self.process.handle("/server").advertise_service("/add_crazyflie", AddCrazyflie, serve)
        self.node = CrazyflieAddNode()
        self.has_begun = self.process.launch(self.node, "/add", parameters)


def test_defaults_are_those_of_the_cpp_driver():
    launch = Launch(PARAMETERS)
    (request,) = launch.requests
    assert (request.uri, request.tf_prefix) == ("udp://127.0.0.1:19850", "cf1")
    assert (request.roll_trim, request.pitch_trim) == (0.0, 0.0)
    flags = {name: getattr(request, name) for name in request.__slots__ if "enable" in name}
    assert flags.pop("enable_logging_pose") is False
    assert set(flags.values()) == {True}
    assert len(flags) == 8
    assert request.use_ros_time is True
    assert request.log_blocks == []
    assert launch.process.exit_status == 0


def test_a_vehicle_may_have_no_prefix():
    for parameters in ({"uri": "usb://0"}, {"uri": "usb://0", "tf_prefix": ""}):
        launch = Launch(parameters)
        assert [request.tf_prefix for request in launch.requests] == [""]
        assert "/add: added usb://0 as /" in launch.process.logged("info")


@pytest.mark.parametrize(
    ("parameters", "refusal", "written", "status"),
    [
        ({"estimator": "kalman"}, "", [["stabilizer/estimator"]], 0),
        ({"estimator": "kalman"}, "not written", [["stabilizer/estimator"]], 1),
        ({}, "", [], 0),
    ],
)
def test_the_estimator_is_set_once_the_vehicle_is_added(parameters, refusal, written, status):
    launch = Launch({**PARAMETERS, **parameters}, answer=(added := Future()))
    updates = []

    def update(request):
        updates.append(request.params)
        if refusal:
            raise ServiceError(refusal)
        return UpdateParamsResponse()

    server = launch.process.handle("/server")
    server.advertise_service("/cf1/update_params", UpdateParams, update)
    assert (updates, launch.process.exit_status) == ([], None)
    added.set_result(AddCrazyflieResponse())
    launch.process.advance(0.1)
    value = 2 if written else None
    assert launch.process.transport.parameters.get("/cf1/stabilizer/estimator") == value
    assert (updates, launch.process.exit_status) == (written, status)
    text = f"it is added, but stabilizer/estimator is not set: {refusal}"
    assert [text in each for each in launch.process.logged("error")] == [True] * status


def test_all_parameters_arrive():
    changes = {
        "roll_trim": 1,
        "pitch_trim": -0.5,
        "enable_logging": False,
        "use_ros_time": False,
        "enable_logging_pose": True,
        "enable_logging_packets": False,
        "genericLogTopics": ["a", "b"],
        "genericLogTopicFrequencies": [10, 500],
        "genericLogTopic_a_Variables": ["pm.vbat"],
        "genericLogTopic_b_Variables": ["mag.x", "mag.y"],
    }
    launch = Launch({**PARAMETERS, **changes})
    (request,) = launch.requests
    # Each is one that the node knows.
    assert launch.process.logged("warn") == []
    assert (request.roll_trim, request.pitch_trim) == (1.0, -0.5)
    assert not request.enable_logging
    assert not request.use_ros_time
    assert request.enable_logging_pose
    assert not request.enable_logging_packets
    blocks = [(b.topic_name, b.frequency, b.variables) for b in request.log_blocks]
    assert blocks == [("a", 10, ["pm.vbat"]), ("b", 500, ["mag.x", "mag.y"])]


def test_a_refusal_ends_the_process_with_status_1():
    launch = Launch(PARAMETERS, refusal="nothing listens on this port")
    assert launch.process.exit_status == 1
    (text,) = launch.process.logged("error")
    assert "nothing listens on this port" in text
    assert text.endswith("; to try again: rosrun crazyflie_driver crazyflie_add __name:=add")


def test_a_process_that_ends_before_the_answer_says_so():
    launch = Launch(PARAMETERS, answer=Future())
    launch.process.shut_down({"/add": launch.node})
    (text,) = launch.process.logged("error")
    assert "ended before udp://127.0.0.1:19850 was added" in text
    done = Launch(PARAMETERS)
    done.process.shut_down({"/add": done.node})
    assert done.process.logged("error") == []


def test_two_launches_at_once_have_nodes_of_two_names():
    path = str(Path(__file__).parents[1] / "launch" / "crazyflie_add.launch")
    configs = [load_config_default([path], None, assign_machines=False) for _ in range(2)]
    first, second = (node.name for config in configs for node in config.nodes)
    assert first != second
    assert first.startswith("crazyflie_add")


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"uri": None}, "uri"),
        ({"tf_prefix": "my vehicle"}, "tf_prefix"),
        ({"roll_trim": "left"}, "roll_trim"),
        ({"enable_logging_imu": 1}, "enable_logging_imu"),
        ({"genericLogTopics": "a"}, "genericLogTopics"),
        ({"genericLogTopics": ["imu"]}, "genericLogTopics"),
        ({"genericLogTopics": ["heading"]}, "genericLogTopics"),
        ({"genericLogTopics": ["/"]}, "genericLogTopics"),
        ({"genericLogTopicFrequencies": [5]}, "genericLogTopicFrequencies"),
        (
            {"genericLogTopics": ["a"], "genericLogTopicFrequencies": [10]},
            "genericLogTopic_a_Variables",
        ),
    ],
)
def test_bad_parameters_are_named(changes, name):
    parameters = {k: v for k, v in {**PARAMETERS, **changes}.items() if v is not None}
    launch = Launch(parameters)
    assert not launch.has_begun
    assert f"parameter /add/{name} " in launch.process.logged("error")[0]
    assert "expected" in launch.process.logged("error")[0]


def test_every_log_block_has_a_period():
    blocks = {"genericLogTopics": ["a"], "genericLogTopic_a_Variables": ["pm.vbat"]}
    launch = Launch({**PARAMETERS, **blocks})
    assert not launch.has_begun
    assert "genericLogTopicFrequencies has 0 entries" in launch.process.logged("error")[0]


def test_all_that_is_wrong_is_named_at_once():
    wrong = {"roll_trim": "left", "genericLogTopics": ["a", "b"], "genericLogTopicFrequencies": [5]}
    (text,) = Launch({**PARAMETERS, **wrong}).process.logged("error")
    for name in ("roll_trim", "genericLogTopicFrequencies", "genericLogTopic_a_Variables"):
        assert f"parameter /add/{name} " in text
