"""Replies to writing parameters: old ones, other ones, none."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from crazyflie_link.errors import NoReplyError, RefusedError

LIMIT = 60.0
EFFECT = b"\0\0"
"""Number of ring.effect."""


def test_an_old_reply_is_not_the_answer_to_the_next_write(vehicle, link):
    vehicle.deaf.add((2, 2, b""))
    with ThreadPoolExecutor() as pool:
        writing = pool.submit(link.parameters.write, "ring.effect", 9)
        vehicle.wait_for_packets(2, 2)
        # To a write of 3, which was given up.
        vehicle.send(2, 2, EFFECT + b"\3")
        vehicle.deaf.clear()
        assert writing.result(timeout=LIMIT) == 9
    assert vehicle.parameters["ring.effect"][1] == 9


def test_a_value_that_the_vehicle_does_not_take(vehicle, link):
    vehicle.answers[2, 2, 0] = EFFECT + b"\6"
    with pytest.raises(RefusedError, match="ring.effect: the vehicle keeps 6 in the place of 9"):
        link.parameters.write("ring.effect", 9)
    assert link.parameters.values()["ring.effect"] == 6


def test_a_write_whose_reply_is_lost_is_looked_up(vehicle, link):
    vehicle.parameters["ring.effect"] = ("B", 9, 0)
    vehicle.deaf.add((2, 2, b""))
    assert link.parameters.write("ring.effect", 9) == 9


def test_a_refusal_of_another_length_is_one_at_once(vehicle, link):
    vehicle.answers[2, 2, 3] = b"\3\0\x0d"
    with pytest.raises(RefusedError, match="sound.freq: the vehicle answers: 0d"):
        link.parameters.write("sound.freq", 100)
    assert len(vehicle.packets(2, 2)) == 1


def test_without_a_reply_to_anything_it_is_the_write_that_failed(vehicle, link):
    vehicle.deaf |= {(2, 1, b""), (2, 2, b"")}
    with pytest.raises(NoReplyError, match="writing ring.effect: .* not replied within 1 s"):
        link.parameters.write("ring.effect", 9)


def test_an_old_confirmation_of_disarming_is_none_of_arming(vehicle, link):
    vehicle.deaf.add((9, 1, b""))
    with ThreadPoolExecutor() as pool:
        arming = pool.submit(link.supervisor.arm)
        vehicle.wait_for_packets(9, 1)
        vehicle.send(9, 1, b"\x81\1\0")
        # Were it taken, nothing would be sent again.
        assert len(vehicle.wait_for_packets(9, 1, 2)) >= 2
        vehicle.deaf.clear()
        arming.result(timeout=LIMIT)
