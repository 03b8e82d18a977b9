"""The faults of the link, with the clock moved by hand."""

import math
import random
from types import SimpleNamespace

import pytest

from crazyflie_virtual.server import Channel


def channel(**faults):
    switches = SimpleNamespace(**{"loss": 0.0, "delay": 0.0, "silence": 0.0, **faults})
    return switches, Channel(switches, random.Random(1))


def test_without_faults_everything_arrives_at_once():
    _, way = channel()
    way.push(1.0, "a")
    way.push(1.0, "b")
    assert way.next_arrival() == 1.0
    assert way.pop(1.0) == ["a", "b"]
    assert way.pop(1.0) == []
    assert way.next_arrival() == math.inf


def test_loss_takes_its_share():
    _, way = channel(loss=0.3)
    for k in range(10000):
        way.push(0.0, k)
    assert len(way.pop(0.0)) == pytest.approx(7000, abs=200)


def test_everything_may_be_lost():
    _, way = channel(loss=1.0)
    for k in range(100):
        way.push(0.0, k)
    assert way.pop(1.0) == []


def test_delay_holds_back_and_keeps_the_order():
    switches, way = channel(delay=0.1)
    way.push(1.0, "a")
    switches.delay = 0.02
    way.push(1.01, "b")
    assert way.pop(1.09) == []
    assert way.next_arrival() == pytest.approx(1.1)
    assert way.pop(1.1) == ["a", "b"]


def test_silence_swallows_what_is_sent_and_what_is_on_the_way():
    switches, way = channel(delay=0.1)
    way.push(0.0, "on the way")
    switches.silence = 0.5
    way.push(0.2, "sent")
    assert way.pop(0.2) == []
    switches.silence = 0.0
    way.push(0.8, "after")
    assert way.pop(1.0) == ["after"]
