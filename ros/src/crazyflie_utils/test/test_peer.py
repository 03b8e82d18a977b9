"""Messages that a rostest has received; all rostests use the rest of the module."""

import pytest
from std_msgs.msg import Float64

from crazyflie_utils.testing import peer


@pytest.fixture
def heard(monkeypatch):
    monkeypatch.setattr(peer, "LIMIT", 0.05)
    heard = peer.Received()
    for number in range(4):
        heard.put(Float64(number))
    return heard


def test_next_passes_over_what_is_not_accepted(heard):
    assert heard.next(lambda message: message.data > 1.0).data == 2.0
    assert heard.next().data == 3.0


def test_what_never_comes_fails_and_names_the_last_message(heard):
    with pytest.raises(AssertionError, match=r"within 0.05 s; the last one: data: 3"):
        heard.next(lambda message: message.data > 9.0)


def test_drain_empties(heard):
    assert [message.data for message in heard.drain()] == [0.0, 1.0, 2.0, 3.0]
    assert heard.drain() == []


def test_wait_until_has_a_limit():
    moments = iter([False, False, True])
    peer.wait_until(lambda: next(moments), "the third")
    with pytest.raises(AssertionError, match=r"waited 0.05 s for rain"):
        peer.wait_until(lambda: False, "rain", 0.05)
