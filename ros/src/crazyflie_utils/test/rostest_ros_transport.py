"""The node handle on a real master: names, topics, services, parameters."""

import math
import queue
import signal
import subprocess
import threading
from concurrent.futures import Future

import pytest
import rosgraph
import rospy
from processes import composed, small_node
from rosgraph_msgs.msg import Log
from std_msgs.msg import Float64, Int64, String
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from crazyflie_utils import ServiceError
from crazyflie_utils.main import ros_process
from crazyflie_utils.parameters.declaration import ParameterError
from crazyflie_utils.parameters.types import BOOLEAN, FINITE, TEXT, Integer
from crazyflie_utils.ros1.calls import ServiceCaller
from crazyflie_utils.testing.peer import LIMIT, wait_until


@pytest.fixture(scope="module")
def process():
    """Return this process's share of the node handles."""
    process = ros_process()
    process.start()
    yield process
    process.stop()


@pytest.fixture(scope="module")
def handle(process):
    return process.handle(rospy.get_name())


@pytest.fixture(scope="module")
def outsiders():
    """Run nodes in another process: a relay /to -> /from, a ledger of /to, a herald."""
    rospy.set_param("/relay", {"offset": 1000, "topics": {"in": "/to", "out": "/from"}})
    rospy.set_param("/ledger", {"topics": {"in": "/to"}})
    rospy.set_param("/herald", {"topics": {"out": "/heralded"}})
    with composed("outsiders", relay="Relay", ledger="Ledger", herald="Herald"):
        yield


@pytest.fixture(scope="module")
def outlet(process, outsiders):
    """Return a publisher of /to that is heard, and a queue of what comes /from there."""
    handle = process.handle("/test")
    heard = queue.Queue()
    handle.subscribe("/from", Int64, heard.put)
    publisher = handle.publisher("/to", Int64)
    wait_until(lambda: publisher._external.has_subscribers(), "the relay to connect")

    def both_ways():
        publisher.publish(Int64(0))
        return not heard.empty()

    wait_until(both_ways, "the relay to answer")
    publisher.publish(Int64(1))
    while heard.get(timeout=LIMIT).data != 1001:
        pass
    return publisher, heard


def test_messages_go_out_and_come_in(outlet):
    publisher, heard = outlet
    for number in range(2, 102):
        publisher.publish(Int64(number))
        assert heard.get(timeout=LIMIT).data == number + 1000


def test_a_line_of_the_log_has_no_list_of_topics(handle):
    lines = []
    subscriber = handle.subscribe("/rosout", Log, lines.append)
    handle.publisher("/one_of_many", String)
    wait_until(subscriber.has_publishers, "the log to connect")

    def is_logged():
        handle.info("a line")
        return any("a line" in each.msg for each in lines)

    wait_until(is_logged, "the line to come")
    subscriber.close()
    assert {topic for each in lines for topic in each.topics} == set()


def test_a_new_topic_has_no_subscribers(handle):
    assert not handle.publisher("/nobody_listens", String)._external.has_subscribers()


def test_latched_message_reaches_an_outsider_that_comes_later(handle):
    handle.publisher("/latched", Float64, latch=True).publish(Float64(2.5))
    echo = subprocess.run(
        ["rostopic", "echo", "-n", "1", "/latched"], capture_output=True, text=True, timeout=LIMIT
    )
    assert "data: 2.5" in echo.stdout


def test_message_that_an_outsider_latched_reaches_every_subscriber(process, outsiders):
    for name in ("/early", "/late"):
        heard = queue.Queue()
        process.handle(name).subscribe("/heralded", Int64, heard.put)
        assert heard.get(timeout=LIMIT).data == 42


def test_process_does_not_connect_to_itself(process, outlet):
    publisher, heard = outlet
    inside = process.handle("/inside").publisher("/from", Int64)
    for number in range(200):
        inside.publish(Int64(-number))
        publisher.publish(Int64(number))
        assert heard.get(timeout=LIMIT).data == -number
        assert heard.get(timeout=LIMIT).data == number + 1000
    assert heard.empty()
    assert not inside._external.has_subscribers()


# Services.


def call(name):
    return rospy.ServiceProxy(name, Trigger)()


def test_service_answers(handle):
    handle.advertise_service("~answer", Trigger, lambda request: TriggerResponse(True, "yes"))
    assert call("~answer").message == "yes"


def test_services_are_known_with_their_nodes(handle, outsiders):
    handle.advertise_service("~known", Trigger, lambda request: TriggerResponse())
    nodes = handle.service_nodes()
    assert nodes[rospy.resolve_name("~known")] == rospy.get_name()
    assert nodes["/outsiders/get_loggers"] == "/outsiders"


def test_service_refuses_with_its_text(handle):
    def refuse(request):
        raise ServiceError("already in flight, at 1.0 m")

    handle.advertise_service("~refuse", Trigger, refuse)
    with pytest.raises(rospy.ServiceException, match="already in flight, at 1.0 m"):
        call("~refuse")


def test_service_that_fails_names_node_and_error(handle):
    handle.advertise_service("~fail", Trigger, lambda request: 1 / 0)
    with pytest.raises(rospy.ServiceException, match=f"{handle.name}: ZeroDivisionError"):
        call("~fail")


def test_service_that_takes_time_lets_callbacks_run(process, handle, outlet):
    publisher, heard = outlet
    work, asked = Future(), queue.Queue()

    def begin(request):
        asked.put(True)
        return work

    handle.advertise_service("~slow", Trigger, begin)
    answer = handle.call_service("~slow", Trigger, TriggerRequest(), LIMIT)
    assert asked.get(timeout=LIMIT)
    publisher.publish(Int64(7))
    assert heard.get(timeout=LIMIT).data == 1007
    assert not answer.done()
    work.set_result(TriggerResponse(True, "late"))
    assert answer.result(LIMIT).message == "late"


def test_calls_of_outsiders(handle, outsiders):
    assert (
        handle.call_service("/ledger/report", Trigger, TriggerRequest(), LIMIT)
        .result(LIMIT)
        .success
    )
    refusal = handle.call_service("/ledger/refuse", Trigger, TriggerRequest(), LIMIT).exception(
        LIMIT
    )
    assert isinstance(refusal, ServiceError)
    assert "the ledger is closed" in str(refusal)


def test_services_of_this_process_are_called_without_connections(handle, monkeypatch):
    names = [f"~number{k}" for k in range(150)]
    for name in names:
        answer = TriggerResponse(True, name)
        handle.advertise_service(name, Trigger, lambda request, answer=answer: answer)
    monkeypatch.delattr(rospy, "ServiceProxy")
    answers = [handle.call_service(name, Trigger, TriggerRequest(), LIMIT) for name in names]
    assert [answer.result(LIMIT).message for answer in answers] == names


def test_a_service_that_another_node_has_taken_over(handle, outsiders):
    called = []
    handle.advertise_service("~mine", Trigger, called.append)
    master = rosgraph.Master("/other")
    uri = master.lookupService("/ledger/report")
    master.registerService(handle.resolve("~mine"), uri, "http://127.0.0.1:1/")
    error = handle.call_service("~mine", Trigger, TriggerRequest(), LIMIT).exception(LIMIT)
    assert "is not a provider of" in str(error)
    assert called == []


def test_call_of_a_service_that_is_not_there(handle):
    error = handle.call_service("/nowhere", Trigger, TriggerRequest(), 0.1).exception(LIMIT)
    assert isinstance(error, ServiceError)
    assert "/nowhere" in str(error)


def test_call_of_a_service_that_does_not_answer(handle):
    handle.advertise_service("~silent", Trigger, lambda request: Future())
    error = handle.call_service("~silent", Trigger, TriggerRequest(), 0.5).exception(LIMIT)
    assert isinstance(error, ServiceError)
    assert str(error) == f"{handle.name}/silent has not answered within 0.5 s"


@pytest.mark.parametrize(
    ("limits", "complaint"),
    [
        ((0.5,), "has not answered within 0.5 s"),
        ((LIMIT, 0.5), "has not been reached within 0.5 s; nothing was done"),
    ],
)
def test_a_stopped_node_does_not_carry_out_a_call_that_was_given_up(handle, limits, complaint):
    with small_node("Ledger", "stopped", "_topics/in:=/to") as node:
        rospy.wait_for_service("/stopped/add", LIMIT)
        node.signal(signal.SIGSTOP)
        answer = handle.call_service("/stopped/add", Trigger, TriggerRequest(), *limits)
        error = answer.exception(LIMIT)
        node.signal(signal.SIGCONT)
        assert str(error) == f"/stopped/add {complaint}"
        report = handle.call_service("/stopped/report", Trigger, TriggerRequest(), LIMIT)
        assert report.result(LIMIT).message == "[]"


@pytest.mark.parametrize("is_own", [True, False])
def test_a_busy_node_does_not_carry_out_a_call_that_was_given_up(handle, is_own):
    name, begun, free = f"~busy{is_own}", threading.Event(), threading.Event()
    called = []

    def work(request):
        called.append(request)
        begun.set()
        free.wait(LIMIT)
        return TriggerResponse()

    handle.advertise_service(name, Trigger, work)
    caller = ServiceCaller()
    if is_own:
        caller.own = handle._process.transport._caller.own
    full = handle.resolve(name)

    def call(limit):
        return caller.call(full, full, Trigger, TriggerRequest(), limit, limit)

    first = call(LIMIT)
    begun.wait(LIMIT)
    assert "has not answered within 0.3 s" in str(call(0.3).exception(LIMIT))
    free.set()
    assert first.result(LIMIT) == TriggerResponse()
    assert call(LIMIT).result(LIMIT) == TriggerResponse()
    assert len(called) == 2


# Parts.


def test_part_of_a_node_takes_down_what_it_has_made(handle):
    part = handle.child()
    publisher = part.publisher("~part_out", String)
    part.subscribe("~part_in", String, lambda message: None)
    part.advertise_service("~part_service", Trigger, lambda request: TriggerResponse())
    names = {handle.resolve(f"~part_{what}") for what in ("out", "in", "service")}

    def known():
        lists = rosgraph.Master("/test").getSystemState()
        return names & {name for entries in lists for name, _ in entries}

    assert known() == names
    part.close()
    wait_until(lambda: not known(), "the master to forget")
    publisher.publish(String("too late, but no error"))


# Parameters.


@pytest.mark.parametrize(
    ("value", "kind"),
    [
        (True, BOOLEAN),
        (7, Integer(7, 7)),
        (-2.5, FINITE),
        ("text", TEXT),
        ({"a": {"b": 1}}, dict),
        ([1, 2.5, "x"], list),
    ],
)
def test_parameters_of_every_type(handle, value, kind):
    rospy.set_param(f"{handle.name}/some/value", value)
    assert handle.get_param("~some/value", kind) == value


def test_parameters_for_others(handle):
    handle.set_param("/cf/ring", {"effect": 7})
    assert rospy.get_param("/cf/ring/effect") == 7
    assert handle.get_param("/cf/ring/effect", Integer(0, 13)) == 7


def test_parameters_that_are_bad_or_missing(handle):
    rospy.set_param(f"{handle.name}/not_a_number", math.nan)
    with pytest.raises(ParameterError, match=f"parameter {handle.name}/not_a_number is nan"):
        handle.get_param("~not_a_number", FINITE)
    with pytest.raises(ParameterError, match=f"parameter {handle.name}/missing is not set"):
        handle.get_param("~missing", FINITE)


# Names: the launch file puts this process into /fleet and remaps.


def test_node_is_in_its_namespace(handle):
    assert handle.name == "/fleet/ros_transport"
    assert handle.resolve("state") == "/fleet/state"
    assert handle.resolve("~state") == "/fleet/ros_transport/state"


@pytest.mark.parametrize(
    ("name", "remapped"),
    [
        ("relative", "/fleet/elsewhere/relative"),
        ("/fleet/relative", "/fleet/elsewhere/relative"),
        ("/absolute", "/elsewhere"),
        ("~private", "/fleet/open"),
        ("left", "/fleet/right"),
        ("right", "/fleet/left"),
        ("other", "/fleet/other"),
    ],
)
def test_remappings_apply_once(handle, name, remapped):
    assert handle.resolve(name) == remapped
    handle.publisher(name, String)
    assert [remapped, "std_msgs/String"] in rospy.get_published_topics()


def test_remapped_topics_are_handed_over(process, handle):
    received = []
    process.handle("/anyone").subscribe("/fleet/elsewhere/relative", String, received.append)
    message = String("x")
    handle.publisher("relative", String).publish(message)
    assert received[0] is message


def test_parameters_are_remapped(handle):
    rospy.set_param("/fleet/parameters/gain", 3.0)
    assert handle.get_param("~gain", FINITE) == 3.0
