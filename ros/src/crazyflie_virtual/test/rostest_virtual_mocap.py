"""The virtual motion capture system, started by roslaunch."""

import queue
import time

import pytest
import rospy
from natnet import NatNetClient

LIMIT = 60.0


def connected_client():
    """Return a client; the server may still be starting."""
    end = time.monotonic() + LIMIT
    while True:
        client = NatNetClient(command_port=17510, use_multicast=False)
        try:
            client.connect(timeout=0.5)
            return client
        except TimeoutError:
            assert time.monotonic() < end, "there is no server"


@pytest.fixture
def stream():
    """Return queues of frames and of models."""
    frames, models = queue.Queue(), queue.Queue()
    client = connected_client()
    client.on_data_frame_received_event.handlers.append(frames.put)
    client.on_data_description_received_event.handlers.append(models.put)
    client.run_async()
    yield client, frames, models
    client.shutdown()


def wait_for_body(frames, is_tracked):
    """Return the first body of a frame with the flag that is asked for."""
    end = time.monotonic() + LIMIT
    while time.monotonic() < end:
        for body in frames.get(timeout=LIMIT).rigid_bodies:
            if body.tracking_valid == is_tracked:
                return body
    raise AssertionError("no such body")


def test_streams_the_vehicle_under_its_name(stream):
    client, frames, models = stream
    assert wait_for_body(frames, True).pos == (0.5, 0.0, 0.0)
    client.request_modeldef()
    assert models.get(timeout=LIMIT).rigid_bodies[0].name == "cf7"


def test_a_switch_is_a_parameter(stream):
    _, frames, _ = stream
    wait_for_body(frames, True)
    rospy.set_param("/virtual_mocap/fault/invalid", "all")
    wait_for_body(frames, False)
    rospy.set_param("/virtual_mocap/fault/invalid", "")
    wait_for_body(frames, True)
