"""Numbered packets of a radio link (safelink): also for a vehicle that is heard late, or again."""

import itertools

import pytest
from usb_bus import PLACES

from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import NoAnswerError
from crazyflie_link.link import LinkTimeouts
from crazyflie_utils.testing.programs import wait_until

PLACE = PLACES[0]
URI = "radio://0/10/2M/E7E7E7E7E7"
COUNT = 100
APP = (13, 2)
"""Port and channel of packets to an application; each one counts, as those of a relative move."""


@pytest.fixture
def vehicle(bus):
    return bus.vehicles[PLACE]


def has_safelink(bus):
    return bus.dongle.chips[PLACE].has_safelink


def lose_a_quarter(bus):
    """Lose acknowledgements, but never four of a row, after which a real one gives up, too."""
    losses = itertools.cycle((True, False, False, True, False, False, False, False))
    bus.dongle.lose = lambda: next(losses)


def send_all(link, vehicle):
    """Return the numbers that arrive."""
    vehicle.received.clear()
    for number in range(COUNT):
        link.send_packet(*APP, bytes([number]))
    vehicle.wait_for(lambda: bytes([COUNT - 1]) in vehicle.packets(*APP))
    return [data[0] for data in vehicle.packets(*APP)]


def test_what_is_sent_again_is_not_received_twice(bus, vehicle, make_link):
    link = make_link(URI)
    link.connect()
    assert has_safelink(bus)
    lose_a_quarter(bus)
    assert send_all(link, vehicle) == [*range(COUNT)]


def test_a_vehicle_that_is_switched_on_late_has_numbered_packets(bus, vehicle, make_link):
    """Cflib asks in its first ten packets only, and goes on without."""
    bus.dongle.silent.add(PLACE)
    sent = itertools.count()
    write = bus.dongle.write

    def write_and_switch_on(*arguments, **options):
        if next(sent) == 30:
            bus.dongle.silent.clear()
        write(*arguments, **options)

    bus.dongle.write = write_and_switch_on
    link = make_link(URI)
    link.connect()
    assert next(sent) > 30
    assert has_safelink(bus)
    lose_a_quarter(bus)
    assert send_all(link, vehicle) == [*range(COUNT)]


def test_a_link_that_comes_back_is_not_deaf(bus, vehicle, states):
    """The chip goes on with numbers, and drops packets without them as repeated ones."""
    link = Crazyflie(URI, reconnect=True, on_state=states)
    try:
        link.connect()
        bus.dongle.silent.add(PLACE)
        states.wait_for(LinkState.LOST)
        wait_until(lambda: link._opening is not None, "an attempt to connect")
        opening = link._opening
        wait_until(lambda: opening.cflib.link is not None, "its driver")
        driver = opening.cflib.link
        sent = driver._thread._retry_before_disconnect
        wait_until(lambda: driver._thread._retry_before_disconnect < sent, "the ten packets")
        assert not driver._thread._has_safelink
        vehicle.received.clear()
        bus.dongle.silent.clear()
        state, text = states.wait_for_first(LinkState.CONNECTED, LinkState.LOST)
        assert state is LinkState.CONNECTED, text
        assert has_safelink(bus)
        link.supervisor.emergency_stop()
        assert vehicle.wait_for_packets(9, 1)
    finally:
        link.close()


def test_a_chip_without_safelink_is_connected_all_the_same(bus, vehicle, make_link, monkeypatch):
    """Other firmware: the request is not a packet that it answers."""
    chip = bus.dongle.chips[PLACE]
    exchange = chip.exchange
    monkeypatch.setattr(
        chip, "exchange", lambda data: b"" if data == b"\xff\x05\x01" else exchange(data)
    )
    link = make_link(URI)
    link.connect()
    assert not has_safelink(bus)
    assert send_all(link, vehicle) == [*range(COUNT)]


def test_the_radio_chip_alone_is_no_answer(bus, vehicle, make_link):
    """It acknowledges while the main processor still starts: another attempt will succeed."""
    vehicle.is_frozen = True
    link = make_link(URI, limits=LinkTimeouts(first_answer=0.5))
    with pytest.raises(NoAnswerError):
        link.connect()
    assert has_safelink(bus)
