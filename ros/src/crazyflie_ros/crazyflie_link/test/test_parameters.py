"""Replies to writing parameters: old ones, other ones, none."""

import struct
from concurrent.futures import ThreadPoolExecutor

import pytest
from cflib.crazyflie.param import (
    MISC_PERSISTENT_CLEAR,
    MISC_PERSISTENT_GET_STATE,
    MISC_PERSISTENT_STORE,
)

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


def state(*values):
    """Return the reply about pid_rate.roll_kp, which has number 1 and is persistent."""
    form = "<BH" + "B" * (len(values) > 0) + "f" * (len(values) - 1)
    return struct.pack(form, MISC_PERSISTENT_GET_STATE, 1, *values)


def test_what_is_stored_of_a_parameter(vehicle, link):
    where, read = (2, 3, MISC_PERSISTENT_GET_STATE), link.parameters.stored
    vehicle.answers[where] = state(1, 0.25, 0.5)
    assert tuple(read("pid_rate.roll_kp")) == (True, 0.25, 0.5)
    vehicle.answers[where] = state(0, 0.25)
    assert tuple(read("pid_rate.roll_kp")) == (False, 0.25, None)
    for answer, text in (
        (state(2, 0.25), "refuses it"),
        (state(0, 0.25)[:-1], "refuses it"),
        (state(1, 0.25), "refuses it"),
        (state(), "answers without a status"),
    ):
        vehicle.answers[where] = answer
        with pytest.raises(RefusedError, match=f"reading the state of pid_rate.roll_kp: .*{text}"):
            read("pid_rate.roll_kp")
    with pytest.raises(RefusedError, match="ring.effect: it is not a persistent parameter"):
        read("ring.effect")


@pytest.mark.parametrize(
    ("command", "number"), [("store", MISC_PERSISTENT_STORE), ("clear", MISC_PERSISTENT_CLEAR)]
)
def test_storing_and_clearing_may_be_refused(vehicle, link, command, number):
    act = getattr(link.parameters, command)
    for status in (0, 2):
        vehicle.answers[2, 3, number] = struct.pack("<BHB", number, 1, status)
        if status:
            with pytest.raises(RefusedError, match="pid_rate.roll_kp: the vehicle refuses it .*2"):
                act("pid_rate.roll_kp")
        else:
            act("pid_rate.roll_kp")


def test_an_answer_without_a_value_is_a_refusal_to_read(vehicle, link):
    vehicle.answers[2, 1, 3] = b"\x03\x00\x02"
    with pytest.raises(RefusedError, match="reading sound.freq: the vehicle answers: 02"):
        link.parameters.read("sound.freq")
    vehicle.answers[2, 1, 3] = b"\x03\x00"
    with pytest.raises(RefusedError, match="the vehicle answers: nothing"):
        link.parameters.read("sound.freq")


def test_an_old_confirmation_of_disarming_does_not_confirm_arming(vehicle, link):
    vehicle.deaf.add((9, 1, b""))
    with ThreadPoolExecutor() as pool:
        arming = pool.submit(link.supervisor.arm)
        vehicle.wait_for_packets(9, 1)
        vehicle.send(9, 1, b"\x81\1\0")
        # Were it taken, nothing would be sent again.
        assert len(vehicle.wait_for_packets(9, 1, 2)) >= 2
        vehicle.deaf.clear()
        arming.result(timeout=LIMIT)
