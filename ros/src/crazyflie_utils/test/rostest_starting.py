"""Registrations during the initialization of nodes, as seen by the master and others."""

import queue
import xmlrpc.client

import pytest
import rosgraph
import rospy
from processes import composed
from std_msgs.msg import Int64
from std_srvs.srv import Trigger, TriggerResponse

from crazyflie_utils.main import ros_process
from crazyflie_utils.testing.peer import LIMIT, wait_until

NAMES = {"/starting/published", "/starting/heard", "/starting/offered"}


@pytest.fixture(scope="module")
def process():
    process = ros_process()
    process.start()
    yield process
    process.stop()


def known():
    """Return which of the names the master knows."""
    state = rosgraph.Master("/test").getSystemState()
    return {name for kind in state for name, _ in kind} & NAMES


def announce(handle):
    """Announce all of the names; return a queue of what is heard."""
    heard = queue.Queue()
    handle.publisher("/starting/published", Int64)
    handle.subscribe("/starting/heard", Int64, heard.put)
    handle.advertise_service("/starting/offered", Trigger, lambda _: TriggerResponse(True, "yes"))
    return heard


def test_all_is_registered_at_the_end(process):
    handle = process.handle("/starting").child()
    with process.transport.starting():
        announce(handle)
        assert not known()
    assert known() == NAMES
    assert rospy.ServiceProxy("/starting/offered", Trigger)().message == "yes"
    assert process.transport.service_nodes()["/starting/offered"] == rospy.get_name()
    handle.close()
    wait_until(lambda: not known(), "all to be taken down")


def test_what_others_publish_is_heard(process):
    rospy.set_param("/herald", {"topics": {"out": "/heralded"}})
    with composed("outside", herald="Herald"):
        wait_until(lambda: ["/heralded", Int64._type] in rospy.get_published_topics(), "the herald")
        handle = process.handle("/starting").child()
        heard = queue.Queue()
        with process.transport.starting():
            handle.subscribe("/heralded", Int64, heard.put)
        assert heard.get(timeout=LIMIT).data == 42
        handle.close()


def test_nothing_is_registered_of_what_cannot_begin(process):
    handle = process.handle("/starting").child()
    with pytest.raises(ZeroDivisionError), process.transport.starting():
        announce(handle)
        raise ZeroDivisionError
    assert not known()
    handle.close()


def test_what_comes_later_is_registered_at_once(process):
    handle = process.handle("/starting").child()
    announce(handle)
    assert known() == NAMES
    handle.close()


@pytest.mark.parametrize("fault", [OSError(), xmlrpc.client.Fault(1, "no such method")])
def test_a_master_that_cannot_do_many_things_at_once_is_told_one_by_one(
    process, monkeypatch, fault
):
    def refuse(_self):
        raise fault

    monkeypatch.setattr("xmlrpc.client.MultiCall.__call__", refuse)
    handle = process.handle("/starting").child()
    with process.transport.starting():
        announce(handle)
    assert known() == NAMES
    handle.close()
