"""The node handle, on a fake process: names, topics, time, parts of a node."""

import threading

import genpy
import pytest
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

LIMIT = 60.0


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
    timer = handle.timer(1.0, lambda: None)
    with pytest.raises(ValueError, match="timer"):
        timer.set_period(period)


def test_a_timer_whose_period_varies(process, handle):
    moments = []
    timer = handle.timer(0.5, lambda: moments.append(handle.time()))
    process.advance(1.0)
    timer.set_period(0.5)
    process.advance(0.25)
    timer.set_period(0.125)
    process.advance(0.25)
    assert moments == [100.5, 101.0, 101.375, 101.5]
    timer.stop()
    timer.set_period(0.25)
    process.advance(1.0)
    assert len(moments) == 4


def test_only_the_latest_message_comes_before_timers_and_services(process, handle):
    seen = []
    handle.subscribe("a", String, lambda message: seen.append(message.data), latest_only=True)
    handle.timer(1.0, lambda: seen.append("tick"))
    handle.advertise_service("go", Trigger, lambda _: seen.append("go") or TriggerResponse())
    for word in ("1", "2", "3"):
        process.publish("/ns/a", String(word))
    assert seen == []
    process.advance(1.0)
    assert seen == ["3", "tick"]
    process.publish("/ns/a", String("4"))
    process.call("/ns/go", None)
    process.advance(1.0)
    assert seen[2:] == ["4", "go", "tick"]


def test_of_two_that_want_the_latest_message_one_may_close(process, handle):
    first, second = [], []
    part = handle.child()
    for owner, seen in ((handle, first), (part, second)):
        owner.subscribe("a", String, seen.append, latest_only=True)
        owner.timer(1.0, lambda: None)
    process.publish("/ns/a", String("1"))
    process.advance(1.0)
    part.close()
    process.publish("/ns/a", String("2"))
    process.advance(1.0)
    assert first == [String("1"), String("2")]
    assert second == [String("1")]


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


@pytest.mark.parametrize(("step", "is_told"), [(0.2, True), (0.1, True), (0.02, False)])
def test_simulated_time_that_moves_in_large_steps_is_told(process, handle, step, is_told):
    handle.timer(0.01, lambda: None)
    # One large step is a jump.
    process.clock.set(500.0)
    for k in range(1, 30):
        process.publish("/clock", Clock(handle.stamp(500.0 + k * step)))
    texts = [each for each in process.logged("warn") if "/clock: simulated time moves" in each]
    assert len(texts) == is_told
    if is_told:
        assert "late; expected at most 0.03 s" in texts[0]
        assert f"{step - 0.01:.2f} s late" in texts[0]


@pytest.mark.parametrize("age", [0.0, 0.25, 70.0])
def test_age_is_the_time_since_the_stamp(process, handle, age):
    process.advance(1000.0)
    assert handle.age(handle.stamp(handle.time() - age)) == pytest.approx(age)


def test_no_stamp_and_one_ahead_say_nothing_about_age(handle):
    assert handle.age(genpy.Time()) == 0.0
    assert handle.age(handle.stamp(handle.time() + 5.0)) == 0.0


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
