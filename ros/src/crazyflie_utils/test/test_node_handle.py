"""The node handle, on a fake process."""

import threading
from concurrent.futures import Future

import pytest
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse, Trigger, TriggerResponse

from crazyflie_utils.runtime.transport import ServiceError
from crazyflie_utils.testing import FakeProcess

LIMIT = 60.0


@pytest.fixture
def process():
    return FakeProcess()


@pytest.fixture
def handle(process):
    return process.handle("/ns/node")


# Names.


@pytest.mark.parametrize(
    ("name", "absolute"),
    [
        ("state", "/ns/state"),
        ("control/final", "/ns/control/final"),
        ("/state", "/state"),
        ("~state", "/ns/node/state"),
        ("~", "/ns/node"),
    ],
)
def test_names_are_resolved_in_the_nodes_namespace(handle, name, absolute):
    assert handle.resolve(name) == absolute


def test_names_at_the_root(process):
    handle = process.handle("/node")
    assert (handle.name, handle.resolve("state")) == ("/node", "/state")


def test_remappings_apply_to_everything(process, handle, monkeypatch):
    monkeypatch.setattr(process.transport, "remap", lambda name: name.replace("/ns/", "/other/"))
    process.transport.parameters["/other/node/gain"] = 2.0
    assert handle.get_param("~gain", float) == 2.0
    handle.publisher("state", String).publish(String("x"))
    assert [m.data for m in process.published("/other/state")] == ["x"]
    handle.advertise_service("~go", Trigger, lambda request: TriggerResponse())
    assert process.call("/other/node/go", None) == TriggerResponse()


# Topics.


def test_nodes_of_a_process_exchange_objects(process):
    received = []
    process.handle("/b").subscribe("/a", String, received.append)
    publisher = process.handle("/a").publisher("/a", String)
    message = String("x")
    publisher.publish(message)
    assert received[0] is message
    assert process.published("/a") == [message]


def test_messages_wait_for_the_present_callback(process, handle):
    order = []
    publisher = handle.publisher("/b", String)

    def on_a(message):
        publisher.publish(String("b"))
        order.append("a is through")

    handle.subscribe("/b", String, lambda message: order.append(message.data))
    handle.subscribe("/a", String, on_a)
    process.publish("/a", String())
    assert order == ["a is through", "b"]


def test_late_subscriber_hears_a_latched_message(process, handle):
    handle.publisher("/a", String, latch=True).publish(String("x"))
    received = []
    process.handle("/late").subscribe("/a", String, received.append)
    assert received == [String("x")]


# Services.


def test_service_answers(process, handle):
    handle.advertise_service(
        "~switch", SetBool, lambda request: SetBoolResponse(request.data, "done")
    )
    answer = process.call("/ns/node/switch", SetBoolRequest(True))
    assert (answer.success, answer.message) == (True, "done")


def test_service_refuses_with_its_text(process, handle):
    def refuse(request):
        raise ServiceError("already in flight")

    handle.advertise_service("go", Trigger, refuse)
    with pytest.raises(ServiceError, match="^already in flight$"):
        process.call("/ns/go", None)
    assert process.logged("error") == []


def test_service_that_fails_is_reported_and_made_safe(process, handle):
    made_safe = []
    handle.on_fault(lambda: made_safe.append(1))
    handle.advertise_service("go", Trigger, lambda request: 1 / 0)
    with pytest.raises(ServiceError, match=r"/ns/node: ZeroDivisionError"):
        process.call("/ns/go", None)
    assert "ZeroDivisionError" in process.logged("error")[0]
    assert made_safe == [1]


def slow_service(handle):
    """Advertise /ns/go, which answers when the returned future does."""
    work = Future()
    handle.advertise_service("go", Trigger, lambda request: work)
    return work


def test_service_that_takes_time_lets_the_node_live_on(process, handle):
    work, ticks = slow_service(handle), []
    handle.timer(0.1, lambda: ticks.append(1))
    answer = process.call("/ns/go", None)
    assert isinstance(answer, Future)
    process.advance(1.0)
    assert len(ticks) == 10
    assert not answer.done()
    work.set_result(TriggerResponse(True, "late"))
    assert answer.result(LIMIT).message == "late"


def test_service_that_takes_time_may_refuse(process, handle):
    work = slow_service(handle)
    answer = process.call("/ns/go", None)
    work.set_exception(ServiceError("lost"))
    with pytest.raises(ServiceError, match="^lost$"):
        answer.result(LIMIT)


@pytest.mark.parametrize("error", [TimeoutError("late"), ZeroDivisionError("x")])
def test_service_that_takes_time_and_fails_is_logged(process, handle, error):
    work = slow_service(handle)
    answer = process.call("/ns/go", None)
    work.set_exception(error)
    with pytest.raises(ServiceError, match=type(error).__name__):
        answer.result(LIMIT)
    assert type(error).__name__ in process.logged("error")[0]


def test_service_that_is_cancelled_says_so(process, handle):
    work = slow_service(handle)
    answer = process.call("/ns/go", None)
    work.cancel()
    with pytest.raises(ServiceError, match="cancelled"):
        answer.result(LIMIT)


def test_nodes_call_services_without_waiting(process, handle):
    handle.advertise_service(
        "go", SetBool, lambda request: SetBoolResponse(request.data, str(order.append("served")))
    )
    order = []

    def call(message):
        future = process.handle("/caller").call_service("/ns/go", SetBool, SetBoolRequest(True), 1)
        future.add_done_callback(lambda done: order.append(done.result().success))
        order.append("called")

    process.handle("/caller").subscribe("/a", String, call)
    process.publish("/a", String())
    assert order == ["called", "served", True]


def test_what_is_added_to_a_call_fails_like_any_callback(process, handle):
    handle.advertise_service("go", Trigger, lambda request: TriggerResponse())
    safe = []
    handle.on_fault(lambda: safe.append(True))

    def fail(done):
        raise ValueError(f"success is {done.result().success}")

    for service in ("go", "gone"):
        handle.call_service(service, Trigger, None, 1.0).add_done_callback(fail)
    assert safe == [True, True]
    errors = process.logged("error")
    assert ["fail failed\nTraceback" in text for text in errors] == [True, True]
    assert "ValueError: success is False" in errors[0]
    assert "ServiceError: there is no service /ns/gone" in errors[1]


def test_called_service_that_refuses_or_is_missing(process, handle):
    def refuse(request):
        raise ServiceError("no")

    handle.advertise_service("go", Trigger, refuse)
    assert str(handle.call_service("go", Trigger, None, 1.0).exception(LIMIT)) == "no"
    assert "/ns/gone" in str(handle.call_service("gone", Trigger, None, 1.0).exception(LIMIT))


# Time.


def test_timers_fire_by_simulated_time(process, handle):
    moments = []
    handle.timer(0.25, lambda: moments.append(handle.time()))
    process.advance(1.0)
    assert moments == pytest.approx([100.25, 100.5, 100.75, 101.0])
    assert handle.uses_sim_time


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan")])
def test_periods_that_never_end_are_refused(handle, period):
    with pytest.raises(ValueError, match="timer"):
        handle.timer(period, lambda: None)


def test_timers_go_on_after_a_reset_of_time(process, handle):
    moments = []
    handle.timer(0.5, lambda: moments.append(handle.time()))
    process.advance(0.5)
    process.clock.set(2.0)
    process.advance(1.0)
    assert moments == pytest.approx([100.5, 2.5, 3.0])


def test_clock_from_outside_moves_time(process, handle):
    ticks = []
    handle.timer(1.0, lambda: ticks.append(handle.time()))
    stamp = handle.stamp(101.5)
    process.publish("/clock", Clock(stamp))
    assert handle.time() == 101.5
    assert handle.stamp() == stamp
    assert ticks == [101.5]


def test_clock_publisher_moves_time_after_the_present_callback(process):
    set_clock = process.handle("/simulator").clock_publisher()
    handle = process.handle("/node")
    seen = []
    handle.timer(1.0, lambda: seen.append(("tick", handle.time())))

    def on_a(message):
        set_clock(101.0)
        seen.append(("callback", handle.time()))

    handle.subscribe("/a", String, on_a)
    process.publish("/a", String())
    assert seen == [("callback", 100.0), ("tick", 101.0)]
    assert [message.clock.to_sec() for message in process.published("/clock")] == [101.0]


# Log and faults.


def test_log_names_the_node(process, handle):
    for level in ("info", "warn", "error"):
        getattr(handle, level)("text")
        assert process.logged(level) == ["/ns/node: text"]


def test_throttled_warnings(process, handle, monkeypatch):
    now = [50.0]
    monkeypatch.setattr("crazyflie_utils.runtime.handle_base.time.monotonic", lambda: now[0])
    for _ in range(3):
        handle.warn("a", throttle=1.0)
        handle.warn("b", throttle=1.0)
        handle.warn("c 1", throttle=1.0, key="c")
        handle.warn("c 2", throttle=1.0, key="c")
    assert process.logged("warn") == [f"/ns/node: {text}" for text in ("a", "b", "c 1")]
    now[0] = 51.0
    handle.warn("a", throttle=1.0)
    handle.warn("always")
    handle.warn("always")
    assert [text[-6:] for text in process.logged("warn")[3:]] == ["ode: a", "always", "always"]


def failing(process):
    """Return a handle whose subscriber of /a fails, by the message's text."""
    handle = process.handle("/ns/node")

    def on_message(message):
        if message.data == "value":
            int("x")
        raise KeyError(message.data)

    handle.subscribe("/a", String, on_message)
    return handle


def test_fault_is_logged_once_with_its_traceback(process):
    failing(process)
    for _ in range(50):
        process.publish("/a", String("key"))
    (error,) = process.logged("error")
    assert "on_message failed" in error
    assert "Traceback" in error
    assert "raise KeyError(message.data)" in error
    (again,) = process.logged("warn")
    assert "on_message failed again: KeyError('key') (2 times)" in again


def test_another_fault_is_logged_too(process):
    failing(process)
    process.publish("/a", String("key"))
    process.publish("/a", String("value"))
    assert ["ValueError" in error for error in process.logged("error")] == [False, True]


def test_node_is_told_of_every_fault(process):
    made_safe = []
    failing(process).on_fault(lambda: made_safe.append(1))
    for _ in range(3):
        process.publish("/a", String("key"))
    assert made_safe == [1, 1, 1]


def test_make_safe_that_fails_is_logged(process):
    failing(process).on_fault(lambda: {}["nothing"])
    process.publish("/a", String("value"))
    assert "make_safe failed too: KeyError('nothing')" in process.logged("error")[1]


def test_faults_of_one_node_leave_others_alone(process):
    failing(process)
    received, ticks = [], []
    process.handle("/other").subscribe("/a", String, received.append)
    process.publish("/a", String("key"))
    assert len(received) == 1
    process.handle("/other").timer(0.1, lambda: ticks.append(1))
    process.advance(0.2)
    assert len(ticks) == 2


def test_timer_survives_an_exception(process, handle):
    ticks = []

    def tick():
        ticks.append(1)
        raise RuntimeError("every time")

    handle.timer(0.1, tick)
    process.advance(1.0)
    assert len(ticks) == 10
    assert len(process.logged("error")) == 1


def test_callbacks_of_many_threads_never_meet(process, handle):
    inside, met = threading.Lock(), []

    def on_message(message):
        met.append(not inside.acquire(blocking=False))
        met.append(False)
        inside.release()

    for topic in ("/a", "/b"):
        handle.subscribe(topic, String, on_message)

    def publish(topic):
        for _ in range(200):
            process.publish(topic, String())

    threads = [
        threading.Thread(target=publish, args=(topic,), daemon=True) for topic in ("/a", "/b") * 3
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT)
    assert len(met) == 2 * 6 * 200
    assert not any(met)


# Parts of a node, other threads, the end.


def test_a_part_of_a_node_takes_down_what_it_has_made(process, handle):
    received = []
    part = handle.child()
    part.subscribe("a", String, received.append)
    part.advertise_service("go", Trigger, lambda request: TriggerResponse())
    part.timer(1.0, lambda: received.append("tick"))
    publisher = part.publisher("b", String)
    handle.subscribe("a", String, lambda message: received.append("node"))
    process.publish("/ns/a", String("x"))
    process.advance(1.0)
    assert received == [String("x"), "node", "tick"]
    part.close()
    process.publish("/ns/a", String("y"))
    process.advance(5.0)
    assert received[3:] == ["node"]
    with pytest.raises(KeyError):
        process.call("/ns/go", None)
    publisher.publish(String("too late, but no error"))


def test_a_callback_of_a_part_that_waits_does_not_begin_after_its_end(process, handle):
    part = handle.child()
    ran = []
    part.subscribe("a", String, lambda message: ran.append(message))

    def end_it(_):
        handle.publisher("a", String).publish(String("x"))
        part.submit(ran.append, "soon")
        part.close()

    handle.subscribe("end", String, end_it)
    process.publish("/ns/end", String())
    assert ran == []


def test_a_service_of_a_part_that_waits_refuses_after_its_end(process, handle):
    part = handle.child()
    part.advertise_service("go", Trigger, lambda request: TriggerResponse())
    answers = []

    def call_and_end(_):
        answers.append(handle.call_service("go", Trigger, None, 1.0))
        part.close()

    handle.subscribe("end", String, call_and_end)
    process.publish("/ns/end", String())
    assert "has ended this service" in str(answers[0].exception(LIMIT))


def test_a_part_that_was_made_early_is_made_safe_too(process, handle):
    part, safe = handle.child(), []
    handle.on_fault(lambda: safe.append(True))
    part.submit(lambda: 1 / 0)
    assert safe == [True]


def test_what_a_part_took_down_can_be_made_again(process, handle):
    for _ in range(2):
        part = handle.child()
        part.publisher("a", String)
        part.advertise_service("go", Trigger, lambda request: TriggerResponse())
        assert process.call("/ns/go", None) == TriggerResponse()
        part.close()


def test_faults_of_a_part_are_the_nodes(process, handle):
    safe = []
    handle.on_fault(lambda: safe.append(True))
    handle.child().submit(lambda: 1 / 0)
    assert safe == [True]
    assert "ZeroDivisionError" in process.logged("error")[0]


def test_another_thread_hands_over(process, handle):
    ran = []
    thread = threading.Thread(target=handle.submit, args=(ran.append, 1))
    thread.start()
    thread.join(LIMIT)
    assert ran == [1]


def test_parameters_of_others(process, handle):
    handle.set_param("/cf/ring", {"effect": 7, "more": {"deep": 1.5}})
    handle.set_param("own", True)
    assert process.transport.parameters["/ns/own"] is True
    assert handle.get_param("/cf/ring/effect", int) == 7
    assert handle.get_param("/cf/ring/more/deep", float) == 1.5
    assert handle.get_param("/cf/ring/none", int, 3) == 3


def test_the_end_of_the_process(process, handle):
    assert process.exit_status is None
    handle.end(3)
    assert process.exit_status == 3
