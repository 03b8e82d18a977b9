"""Whose datagrams count: addresses of server, sender and interface."""

import contextlib
import socket
import threading
import time
from types import SimpleNamespace

import pytest
from natnet_connection import GROUP, LIMIT, connection, is_named, server, wait_for_frame

from crazyflie_utils.testing.programs import free_port
from crazyflie_virtual import natnet
from mocap_optitrack import natnet_source as module
from mocap_optitrack.mocap_parameters import NatNetParameters
from mocap_optitrack.natnet_source import NatNetSource
from mocap_optitrack.source import SourceError


@contextlib.contextmanager
def forger(encoder):
    """Return a function that sends frames, names and descriptions of a server to a port.

    They come from another address of this machine, and show body 1 elsewhere.
    """
    elsewhere = natnet.StreamedBody(1, "forged", (9.0, 9.0, 9.0), (0.0, 0.0, 0.0, 1.0), True)
    now = time.monotonic()
    messages = [
        encoder.server_info("forged", 1511, None),
        encoder.model([elsewhere]),
        encoder.frame(1, [elsewhere], now, now, now),
    ]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind(("127.0.0.2", 0))

        def forge(port, host="127.0.0.1", names_only=False):
            for message in messages[:2] if names_only else messages:
                sender.sendto(message, (host, port))

        yield forge


def names_while(source, disturb):
    """Return what bodies 1 and 7 are called in 50 frames, each after a disturbance."""
    seen = set()
    for _ in range(50):
        disturb()
        frame = wait_for_frame(source)
        seen |= {(body.body_id, body.name, body.position) for body in frame.bodies}
    return seen


GENUINE = {(1, "cf1", (1.0, 2.0, 3.0)), (7, "cf7", (7.0, 2.0, 3.0))}


def test_unicast_datagrams_of_another_sender_change_nothing(monkeypatch):
    # The port takes them: this is about the sender, not about the local address.
    monkeypatch.setattr(NatNetSource, "_interface", lambda self: "0.0.0.0")
    warnings = []
    with (
        server() as running,
        connection(running.address[1], warn=warnings.append) as (source, _),
        forger(natnet.Encoder("3.1")) as forge,
    ):
        wait_for_frame(source, is_named)
        port = source._commands.getsockname()[1]
        assert names_while(source, lambda: forge(port)) == GENUINE
    (text,) = warnings
    assert text.startswith("ignoring a datagram from 127.0.0.2: the NatNet server is at 127.0.0.1")


def test_multicast_datagrams_of_another_sender_change_nothing():
    data_port = free_port()
    warnings = []
    with (
        server(multicast=True, data_port=data_port) as running,
        connection(running.address[1], warn=warnings.append) as (source, _),
        forger(natnet.Encoder("3.1")) as forge,
    ):
        wait_for_frame(source, is_named)
        assert names_while(source, lambda: forge(data_port, GROUP)) == GENUINE
    assert "from 127.0.0.2" in warnings[0]


def test_the_first_frame_of_a_group_decides_about_its_server(monkeypatch):
    monkeypatch.setattr(module, "_ANSWER_LIMIT", 0.1)
    data_port = free_port()
    settings = {
        "server_address": None,
        "version": "3.1",
        "multicast_address": GROUP,
        "data_port": data_port,
        "local_address": "127.0.0.1",
    }
    with (
        server(multicast=True, data_port=data_port),
        connection(free_port(), warn=lambda text: None, **settings) as (source, _),
        forger(natnet.Encoder("3.1")) as forge,
    ):
        forge(source._commands.getsockname()[1], names_only=True)
        wait_for_frame(source)
        seen = names_while(source, lambda: forge(data_port, GROUP))
    assert seen == {(1, None, (1.0, 2.0, 3.0)), (7, None, (7.0, 2.0, 3.0))}


def test_datagrams_that_are_no_answer_do_not_put_off_the_next_request(monkeypatch):
    now, asked = [0.0], []

    def select(sockets, writers, errors, limit):
        # Something comes every 0.3 s.
        now[0] += min(limit, 0.3)
        return [], [], []

    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(module, "select", SimpleNamespace(select=select))
    monkeypatch.setattr(NatNetSource, "_send_connect", lambda *_: asked.append(now[0]))
    with pytest.raises(SourceError, match="no NatNet server answers"), connection(1):
        pass
    assert asked == pytest.approx([0.0, 0.5, 1.0, 1.5])


def test_the_answer_of_another_sender_is_ignored():
    warnings = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as commands:
        commands.bind(("127.0.0.1", 0))
        commands.settimeout(LIMIT)
        port = commands.getsockname()[1]
        source = NatNetSource(
            NatNetParameters(server_address="127.0.0.1", command_port=port),
            time.monotonic,
            warnings.append,
        )
        opened = []
        opening = threading.Thread(target=lambda: opened.append(source.open()))
        opening.start()
        _, client = commands.recvfrom(100)
        with forger(natnet.Encoder("4.1")) as forge:
            forge(client[1])
        commands.sendto(natnet.Encoder("3.1").server_info("genuine", 1511, None), client)
        opening.join(LIMIT)
        source.close()
    assert opened == [f"genuine at 127.0.0.1:{port}, NatNet 3.1, unicast"]
    assert "from 127.0.0.2: the NatNet server is at 127.0.0.1" in warnings[0]


@pytest.mark.parametrize(
    ("settings", "address"),
    [
        ({"local_address": "127.0.0.3"}, "127.0.0.3"),
        ({"local_address": "127.0.0.3", "server_address": None}, "127.0.0.3"),
        ({}, "127.0.0.1"),
    ],
)
def test_only_the_local_address_is_bound(settings, address):
    with server() as running, connection(running.address[1], **settings) as (source, _):
        wait_for_frame(source)
        assert source._commands.getsockname()[0] == address


def test_an_answer_to_a_broadcast_may_come_from_any_address():
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as commands,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as answers,
    ):
        commands.bind(("127.255.255.255", 0))
        commands.settimeout(LIMIT)
        answers.bind(("127.0.0.2", 0))
        settings = NatNetParameters(
            server_address="127.255.255.255", command_port=commands.getsockname()[1]
        )
        source = NatNetSource(settings, time.monotonic, pytest.fail)
        opened = []
        opening = threading.Thread(target=lambda: opened.append(source.open()))
        opening.start()
        _, client = commands.recvfrom(100)
        answers.sendto(natnet.Encoder("3.1").server_info("genuine", 1511, None), client)
        opening.join(LIMIT)
        source.close()
    assert opened[0].startswith("genuine at 127.0.0.2")
