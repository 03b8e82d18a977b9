"""Requests and answers, without a vehicle."""

import threading

import pytest

from crazyflie_link.errors import LinkLostError, NoReplyError
from crazyflie_link.transmission import Request, Transmission


class Requests(Transmission):
    """Requests that are sent at once."""

    def request(self, send, request):
        return super().request(send, request, lambda send: send())


def test_the_answer_is_the_first_packet_that_fits():
    requests = Requests()

    def send():
        requests.receive(8, 1, b"\x07 other channel")
        requests.receive(9, 0, b"\x07 other port")
        requests.receive(8, 0, b"\x08 other command")
        requests.receive(8, 0, b"\x07 this one")
        requests.receive(8, 0, b"\x07 too late")

    assert requests.request(send, Request(8, 0, b"\x07", "a test")) == b"\x07 this one"


def test_equal_requests_are_answered_in_their_order():
    requests = Requests()
    answers = {}
    asked = threading.Semaphore(0)

    def ask(name):
        answers[name] = requests.request(asked.release, Request(2, 1, b"\x01", name, resend=False))

    threads = [threading.Thread(target=ask, args=(name,)) for name in ("first", "second")]
    for thread in threads:
        thread.start()
        assert asked.acquire(timeout=120.0)
    requests.receive(2, 1, b"\x01 a")
    requests.receive(2, 1, b"\x01 b")
    for thread in threads:
        thread.join(timeout=120.0)
    assert answers == {"first": b"\x01 a", "second": b"\x01 b"}


def test_a_lost_request_is_sent_again():
    requests = Requests()
    sent = []

    def send():
        sent.append(True)
        if len(sent) == 3:
            requests.receive(4, 2, b"x")

    assert requests.request(send, Request(4, 2, b"x", "a test", limit=60.0)) == b"x"


def test_what_must_not_be_done_twice_is_sent_once():
    requests = Requests()
    sent = []
    with pytest.raises(NoReplyError, match="the jump: .* may or may not have been carried out"):
        requests.request(
            lambda: sent.append(True), Request(8, 0, b"", "the jump", resend=False, limit=0.5)
        )
    assert len(sent) == 1


def test_a_request_that_has_ended_is_withdrawn_from_the_queue():
    requests, queue, sent = Transmission(), [], []
    request = Request(8, 0, b"", "the jump", resend=False, limit=0.01)
    with pytest.raises(NoReplyError):
        requests.request(lambda: sent.append(True), request, queue.append)
    for send in queue:
        send()
    assert len(queue) == 1
    assert not sent


def test_no_request_waits_for_an_answer_beyond_the_limit_or_the_end_of_the_link():
    requests = Requests()
    with pytest.raises(NoReplyError, match="a test: the vehicle has not replied within 0.05 s"):
        requests.request(lambda: None, Request(8, 0, b"", "a test", limit=0.05))
    with pytest.raises(LinkLostError, match="a test: gone"):
        requests.request(lambda: requests.close("gone"), Request(8, 0, b"", "a test", limit=30.0))
    with pytest.raises(LinkLostError, match="a test: gone"):
        requests.request(lambda: None, Request(8, 0, b"", "a test", limit=30.0))


def test_an_answer_without_a_request_is_nothing():
    requests = Requests()
    requests.receive(8, 0, b"early")
    with pytest.raises(NoReplyError):
        requests.request(lambda: None, Request(8, 0, b"early", "a test", limit=0.01))
