"""The fake process against what a real one would do."""

from concurrent.futures import Future

import genpy
import pytest
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger, TriggerResponse

from crazyflie_utils.testing import FakeProcess


def test_time_begins_where_it_is_told():
    assert FakeProcess().handle("/node").time() == 100.0
    assert FakeProcess(start=5.0).handle("/node").stamp() == genpy.Time(5)


def test_advance_stops_at_every_deadline_in_order(process):
    handle = process.handle("/node")
    ticks = []
    for period in (0.3, 0.2):
        handle.timer(period, lambda period=period: ticks.append((period, round(handle.time(), 9))))
    process.advance(0.65)
    assert ticks == [(0.2, 100.2), (0.3, 100.3), (0.2, 100.4), (0.3, 100.6), (0.2, 100.6)]
    assert handle.time() == pytest.approx(100.65)


def test_advance_in_small_steps_misses_nothing(process):
    ticks = []
    process.handle("/node").timer(0.1, lambda: ticks.append(1))
    for _ in range(1000):
        process.advance(0.01)
    assert len(ticks) == 100


def test_parameters_of_the_process_and_of_launch():
    process = FakeProcess({"/shared/a": 1})
    process.launch(Launched(), "/node", {"b": 2})
    assert process.handle("/shared").get_param("~a", int) == 1
    assert process.handle("/node").get_param("~b", int) == 2


class Launched:
    """A node without a base class."""

    def initialize(self, handle):
        self.name = handle.name
        return handle.get_param("~b", int) == 2


def test_launch_returns_what_initialize_returns(process):
    node = Launched()
    assert process.launch(node, "/node", {"b": 2}) is True
    assert process.launch(node, "/other", {"b": 3}) is False
    assert node.name == "/other"


def test_published_in_order_by_all_publishers_of_a_topic(process):
    first, second = (process.handle(name).publisher("/t", String) for name in ("/a", "/b"))
    assert process.published("/t") == []
    for publisher, text in ((first, "1"), (second, "2"), (first, "3")):
        publisher.publish(String(text))
    assert [message.data for message in process.published("/t")] == ["1", "2", "3"]


def test_what_could_not_be_sent_is_refused(process):
    publisher = process.handle("/a").publisher("/t", Float64)
    with pytest.raises(genpy.SerializationError):
        publisher.publish(Float64("text"))
    with pytest.raises(TypeError):
        publisher.publish(String("1.0"))
    assert process.published("/t") == []


def test_names_that_do_not_exist_are_named(process):
    handle = process.handle("/node")
    handle.publisher("/out", String)
    handle.subscribe("/in", String, lambda message: None)
    handle.advertise_service("/go", Trigger, lambda request: TriggerResponse())
    with pytest.raises(KeyError, match=r"no publisher of /ouch; known: \['/out'\]"):
        process.published("/ouch")
    with pytest.raises(KeyError, match=r"no subscriber of /im; known: \['/clock', '/in'\]"):
        process.publish("/im", String())
    with pytest.raises(KeyError, match=r"no service /gone; known: \['/go'\]"):
        process.call("/gone", None)


def test_log_by_level(process):
    handle = process.handle("/node")
    handle.info("a")
    handle.warn("b")
    handle.info("c")
    assert process.logged("info") == ["/node: a", "/node: c"]
    assert process.logged("error") == []


@pytest.fixture
def ticks(process):
    """Return the times at which a timer by each clock fires."""
    fired = {"simulated": [], "machine": []}
    for name, clock in (("simulated", process.clock), ("machine", process.machine_clock)):
        process.handle("/node").timer(
            1.0, lambda name=name, clock=clock: fired[name].append(clock.time()), name == "machine"
        )
    return fired


def test_time_passes_by_both_clocks(process, ticks):
    process.advance(2.5)
    assert ticks == {"simulated": [101.0, 102.0], "machine": [101.0, 102.0]}


def test_the_machine_s_time_passes_while_simulated_time_stands(process, ticks):
    process.advance_machine(2.5)
    assert ticks == {"simulated": [], "machine": [101.0, 102.0]}
    process.advance(0.5)
    assert ticks == {"simulated": [], "machine": [101.0, 102.0, 103.0]}


def test_simulated_time_that_jumps_or_is_reset_moves_no_machine_s_timer(process, ticks):
    process.advance(0.9)
    process.clock.set(150.0)
    process.clock.set(0.0)
    assert ticks == {"simulated": [150.0], "machine": []}
    process.advance(0.2)
    assert ticks == {"simulated": [150.0], "machine": [101.0]}


def test_a_timer_as_fast_as_the_machine_ends_with_the_time(process):
    fired = []
    process.handle("/node").timer(0.0, lambda: fired.append(1), steady=True)
    process.advance_machine(0.01)
    assert len(fired) > 10


def test_a_call_that_is_not_answered_fails_by_the_machine_s_time(process):
    handle = process.handle("/node")
    handle.advertise_service("/slow", Trigger, lambda request: Future())
    answer = handle.call_service("/slow", Trigger, None, 2.0)
    process.clock.set(200.0)
    process.advance_machine(1.9)
    assert not answer.done()
    process.advance_machine(0.2)
    assert str(answer.exception(0.0)) == "/slow has not answered within 2 s"


def test_a_late_answer_comes_before_the_limit(process):
    handle, slow = process.handle("/node"), Future()
    handle.advertise_service("/slow", Trigger, lambda request: slow)
    answer = handle.call_service("/slow", Trigger, None, 2.0)
    process.advance(1.0)
    slow.set_result(TriggerResponse(message="done"))
    process.advance(5.0)
    assert answer.result(0.0).message == "done"


def test_time_never_steps_back(process):
    """A deadline just past the end by a rounding error is not a reset of the simulation."""
    times = []
    process.clock.on_change(lambda time, is_reset: times.append((time, is_reset)))
    process.handle("/node").timer(0.01, lambda: None)
    for _ in range(500):
        process.advance(0.07)
    assert times == sorted(times)
    assert not any(is_reset for _, is_reset in times)
