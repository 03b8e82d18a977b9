"""The thread that sends: order, latest values, and a radio that blocks."""

import threading

import pytest

from crazyflie_link.errors import LinkLostError
from crazyflie_link.transmission import Transmission

LIMIT = 60.0


class Radio:
    """A radio that sends nothing until it is let."""

    def __init__(self):
        self.queue = Transmission()
        self.sent = []
        self.free = threading.Event()
        entered = threading.Event()

        def block():
            self.thread = threading.current_thread()
            entered.set()
            self.free.wait(LIMIT)

        self.queue.put(block)
        assert entered.wait(LIMIT)

    def note(self, what):
        return lambda: self.sent.append(what)

    def let_go(self):
        """Send all waiting packets, and return them."""
        done = threading.Event()
        self.queue.put_latest("end", done.set)
        self.free.set()
        assert done.wait(LIMIT)
        return self.sent


@pytest.fixture
def radio():
    radio = Radio()
    yield radio
    radio.queue.close()


def test_commands_keep_their_order(radio):
    for k in range(50):
        radio.queue.put(radio.note(k))
    assert radio.let_go() == list(range(50))


def test_of_a_stream_only_the_latest_is_sent(radio):
    for k in range(1000):
        radio.queue.put_latest("setpoint", radio.note(f"setpoint {k}"))
        radio.queue.put_latest("position", radio.note(f"position {k}"))
    assert radio.let_go() == ["setpoint 999", "position 999"]


def test_an_emergency_comes_first_and_alone(radio):
    radio.queue.put_latest("setpoint", radio.note("setpoint"))
    radio.queue.put(radio.note("command"))
    radio.queue.put(radio.note("stop"), urgent=True)
    assert radio.let_go() == ["stop", "command"]


def test_what_is_discarded_is_not_sent(radio):
    radio.queue.put_latest("setpoint", radio.note("setpoint"))
    radio.queue.discard("setpoint")
    assert radio.let_go() == []


def test_a_stuck_radio_is_an_error_and_no_memory_leak(radio):
    for k in range(256):
        radio.queue.put(radio.note(k))
    with pytest.raises(LinkLostError, match="256 packets wait to be sent"):
        radio.queue.put(radio.note(256))
    radio.queue.put(radio.note("stop"), urgent=True)
    assert radio.let_go()[0] == "stop"


def test_one_failure_does_not_end_it(radio, caplog):
    def fail():
        raise OSError("broken")

    radio.queue.put(fail)
    radio.queue.put(radio.note("next"))
    assert radio.let_go() == ["next"]
    assert "broken" in caplog.text


def test_nothing_is_taken_after_the_end(radio):
    radio.queue.close()
    with pytest.raises(LinkLostError):
        radio.queue.put(radio.note(1))
    with pytest.raises(LinkLostError):
        radio.queue.put_latest("setpoint", radio.note(1))


def test_what_waits_at_the_end_is_not_sent(radio):
    radio.queue.put(radio.note("command"))
    radio.queue.put_latest("setpoint", radio.note("setpoint"))
    radio.queue.close()
    radio.free.set()
    radio.thread.join(LIMIT)
    assert not radio.thread.is_alive()
    assert radio.sent == []


@pytest.mark.parametrize("reason", ["the vehicle has not been heard for 0.45 s", ""])
def test_a_queue_that_is_closed_says_why(reason):
    queue = Transmission()
    queue.close(reason)
    for put in (queue.put, lambda send: queue.put_latest("stream", send)):
        with pytest.raises(LinkLostError) as caught:
            put(lambda: None)
        assert str(caught.value) == reason
