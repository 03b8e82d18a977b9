"""Nodes that share a process, as outsiders see them."""

import json
import xmlrpc.client

import pytest
import rosgraph
import rospy
from processes import composed
from std_msgs.msg import Int64
from std_srvs.srv import Trigger

from crazyflie_utils.testing.peer import LIMIT, listening, wait_until

COUNT = 100


@pytest.fixture(scope="module")
def chain():
    """Run /a -> first -> /b -> second -> /c -> ledger in one process."""
    rospy.set_param("/first", {"offset": 1000, "topics": {"in": "/a", "out": "/b"}})
    rospy.set_param("/ns/second", {"offset": 20000, "topics": {"in": "/b", "out": "/c"}})
    rospy.set_param("/ledger", {"topics": {"in": "/c"}})
    nodes = {"first": "Relay", "ns/second": "Relay", "ledger": "Ledger"}
    with composed("chain", **nodes) as process:
        yield process


@pytest.fixture(scope="module")
def ends(chain):
    """Return outside publishers of /a and /b and queues of /b and /c, all connected."""
    publishers = {topic: rospy.Publisher(topic, Int64, queue_size=COUNT) for topic in ("/a", "/b")}
    with listening("/b", Int64) as b, listening("/c", Int64) as c:
        for topic, publisher in publishers.items():
            wait_until(lambda publisher=publisher: publisher.get_num_connections(), topic)

            def is_through(publisher=publisher):
                publisher.publish(Int64(-1))
                return not c.empty()

            wait_until(is_through, f"a message from {topic} on /c")
            publisher.publish(Int64(-2 if topic == "/a" else 998))
            while c.get(timeout=LIMIT).data != 20998:
                pass
        yield publishers["/a"], publishers["/b"], b, c


def written():
    """Return the numbers in the ledger."""
    return json.loads(rospy.ServiceProxy("/ledger/report", Trigger)().message)


def test_each_node_has_parameters_and_services_under_its_own_name(ends):
    services = {name for name, _ in rosgraph.Master("/test").getSystemState()[2]}
    assert services >= {"/ledger/report", "/ledger/refuse"}
    assert rospy.get_param("/ns/second/offset") == 20000
    assert 20998 in written()


def test_every_message_comes_exactly_once(ends):
    a, _, b, c = ends
    before = len(written())
    for number in range(COUNT):
        a.publish(Int64(number))
        assert c.get(timeout=LIMIT).data == number + 21000
    assert written()[before:] == [number + 21000 for number in range(COUNT)]
    heard = [b.get(timeout=LIMIT).data for _ in range(b.qsize())]
    assert heard[-COUNT:] == [number + 1000 for number in range(COUNT)]
    assert c.empty()


def test_outsider_in_the_middle_has_subscribers_exactly_once(ends):
    _, b_publisher, _, c = ends
    before = len(written())
    for number in range(COUNT):
        b_publisher.publish(Int64(number))
        assert c.get(timeout=LIMIT).data == number + 20000
    assert written()[before:] == [number + 20000 for number in range(COUNT)]
    assert c.empty()


def test_a_burst_comes_in_order(ends):
    a, _, _, c = ends
    before = len(written())
    for number in range(10):
        a.publish(Int64(number))
    expected = [number + 21000 for number in range(10)]
    assert [c.get(timeout=LIMIT).data for _ in range(10)] == expected
    assert written()[before:] == expected


def test_process_has_no_connection_to_itself(ends):
    uri = rosgraph.Master("/test").lookupNode("/chain")
    _, _, connections = xmlrpc.client.ServerProxy(uri).getBusInfo("/test")
    peers = {topic: set() for _, _, _, _, topic, *_ in connections}
    for _, peer, _, _, topic, *_ in connections:
        peers[topic].add(peer)
    assert {"/a", "/b", "/c"} <= peers.keys()
    assert not any(own in peers[topic] for own in (uri, "/chain") for topic in peers)
