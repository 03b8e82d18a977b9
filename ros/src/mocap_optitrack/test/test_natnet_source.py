"""Connections to virtual NatNet servers on this machine."""

import contextlib
import socket
import struct
import threading
import time
from collections import Counter

import pytest
from natnet_connection import GROUP, LIMIT, connection, is_named, see, server, wait_for_frame

from crazyflie_utils.testing.programs import free_port
from crazyflie_virtual import natnet
from crazyflie_virtual.mocap import MocapServer, MocapSettings
from crazyflie_virtual.natnet import VERSIONS
from mocap_optitrack import natnet_source as module
from mocap_optitrack.mocap_parameters import NatNetParameters
from mocap_optitrack.natnet_source import NatNetSource
from mocap_optitrack.source import SourceError


@pytest.mark.parametrize("version", VERSIONS)
def test_unicast(version):
    with (
        server(version=version) as running,
        connection(running.address[1]) as (source, description),
    ):
        frame = wait_for_frame(source, is_named)
        port = running.address[1]
    assert description == f"virtual_mocap at 127.0.0.1:{port}, NatNet {version}, unicast"
    one, seven = frame.bodies
    assert (one.body_id, one.name, one.position) == (1, "cf1", (1.0, 2.0, 3.0))
    assert (seven.body_id, seven.name) == (7, "cf7")
    # Server and client share a clock here.
    assert frame.exposure <= frame.sent <= frame.arrival <= time.monotonic()


@pytest.mark.parametrize("version", VERSIONS)
def test_multicast(version):
    data_port = free_port()
    with (
        server(version=version, multicast=True, data_port=data_port) as running,
        connection(running.address[1]) as (source, description),
    ):
        frame = wait_for_frame(source, is_named)
    assert description.endswith(f"NatNet {version}, multicast to {GROUP}:{data_port}")
    assert [body.name for body in frame.bodies] == ["cf1", "cf7"]


def test_the_servers_word_counts_more_than_the_configuration():
    data_port = free_port()
    with (
        server(multicast=True, data_port=data_port) as running,
        connection(running.address[1], multicast_address="224.0.0.1", data_port=9000) as opened,
    ):
        source, description = opened
        wait_for_frame(source)
    assert f"{GROUP}:{data_port} (which overrules the configured 224.0.0.1:9000)" in description


def test_a_server_on_this_machine_is_found_without_its_address():
    with (
        server() as running,
        connection(running.address[1], server_address=None) as (source, description),
    ):
        wait_for_frame(source)
    assert "127.0.0.1" in description


def test_a_group_can_be_heard_without_an_answer(monkeypatch):
    monkeypatch.setattr(module, "_ANSWER_LIMIT", 0.1)
    data_port = free_port()
    settings = {
        "version": "3.1",
        "multicast_address": GROUP,
        "data_port": data_port,
        "local_address": "127.0.0.1",
    }
    with (
        server(multicast=True, data_port=data_port),
        connection(free_port(), **settings) as (source, description),
    ):
        frame = wait_for_frame(source)
    assert description.startswith("a server that does not answer, NatNet 3.1")
    assert [body.body_id for body in frame.bodies] == [1, 7]
    # The rate of the server's clock is not known, so there is but one time.
    assert frame.exposure == frame.sent


def test_a_unicast_server_is_sent_keep_alives(monkeypatch):
    monkeypatch.setattr(module, "_KEEP_ALIVE", 0.01)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as commands:
        commands.bind(("127.0.0.1", 0))
        commands.settimeout(LIMIT)
        source = NatNetSource(
            NatNetParameters(server_address="127.0.0.1", command_port=commands.getsockname()[1]),
            time.monotonic,
            pytest.fail,
        )
        opening = threading.Thread(target=source.open)
        opening.start()
        request, client = commands.recvfrom(100)
        assert natnet.parse(request)[0] == natnet.CONNECT
        commands.sendto(natnet.Encoder("3.1").server_info("old", 1511, None), client)
        opening.join(LIMIT)
        kept_alive = 0
        while kept_alive < 3:
            source.read(0.01)
            request, sender = commands.recvfrom(100)
            # The socket on which it requests the frames.
            assert sender == client
            kept_alive += natnet.parse(request)[0] == natnet.KEEP_ALIVE
        source.close()


def test_a_server_that_was_restarted_is_found_over_the_same_sockets():
    port = free_port()
    with contextlib.ExitStack() as stack:
        with server(port):
            source, _ = stack.enter_context(connection(port))
            wait_for_frame(source)
            sockets = list(source._sockets)
        while source.read(0.0) is not None:
            pass
        assert source.read(0.05) is None
        with server(port):
            wait_for_frame(source)
        assert source._sockets == sockets


def test_a_server_that_became_another_is_connected_to_again(monkeypatch):
    monkeypatch.setattr(module, "_SILENCE", 0.05)
    port = free_port()
    with contextlib.ExitStack() as stack:
        with server(port, version="3.1"):
            source, _ = stack.enter_context(connection(port))
            wait_for_frame(source)
        with (
            server(port, version="4.1", silent=True),
            pytest.raises(SourceError, match=r"is not what it was: virtual_mocap 4\.1"),
        ):
            wait_for_frame(source, lambda frame: False)


def test_a_network_that_is_gone_for_a_moment_is_only_quiet(monkeypatch):
    with server() as running, connection(running.address[1]) as (source, _):
        wait_for_frame(source)
        # Nothing can be sent there.
        monkeypatch.setattr(source, "_server", ("255.255.255.255", 0))
        monkeypatch.setattr(module, "_KEEP_ALIVE", 0.0)
        wait_for_frame(source)


def test_bodies_that_appear_later_get_their_names(monkeypatch):
    monkeypatch.setattr(module, "_NAMES_AGAIN", 0.05)
    settings = MocapSettings(command_port=0, observer_port=0, rate=200.0)
    running = MocapServer(settings)
    running.start()
    try:
        with connection(running.address[1]) as (source, _):
            wait_for_frame(source, lambda frame: not frame.bodies)
            see(running)
            wait_for_frame(source, is_named)
    finally:
        running.stop()


@pytest.mark.parametrize(
    ("multicast", "hint"), [(False, "sends nothing"), (True, f"the multicast group {GROUP}")]
)
def test_a_server_that_is_silent(multicast, hint):
    with (
        server(silent=True, multicast=multicast, data_port=free_port()) as running,
        connection(running.address[1]) as (source, _),
    ):
        assert source.read(0.05) is None
        assert hint in source.silence_hint


def test_no_server(monkeypatch):
    monkeypatch.setattr(module, "_ANSWER_LIMIT", 0.1)
    port = free_port()
    text = f"no NatNet server answers at 127.0.0.1, UDP port {port}: is Motive running"
    with pytest.raises(SourceError, match=text), connection(port):
        pass


def test_a_host_that_is_unknown(monkeypatch):
    def resolve(host):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "gethostbyname", resolve)
    text = "server_address 'motive-pc' is unknown: .* not known"
    with pytest.raises(SourceError, match=text), connection(1510, server_address="motive-pc"):
        pass


def test_an_interface_that_is_not_there():
    with (
        server(multicast=True, data_port=free_port()) as running,
        pytest.raises(SourceError, match="cannot open a NatNet connection"),
        connection(running.address[1], local_address="192.0.2.77"),
    ):
        pass


def test_datagrams_that_mean_nothing_are_told_and_dropped():
    warnings = []
    with (
        server(silent=True) as running,
        connection(running.address[1], warn=warnings.append) as (source, _),
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        source.read(0.0)
        running.switches.silent = False
        wait_for_frame(source)
        (client,) = running._clients
        broken = struct.pack("<HH", 7, 6) + b"broken"
        sender.sendto(b"x", ("127.0.0.1", client[1]))
        sender.sendto(broken, ("127.0.0.1", client[1]))
        end = time.monotonic() + LIMIT
        while len(warnings) < 2 and time.monotonic() < end:
            source.read(0.1)
        wait_for_frame(source)
    assert [text.split(": ")[0] for text in warnings] == ["ignoring a datagram from 127.0.0.1"] * 2
    assert "cannot decode a DataFrame of NatNet 3.1" in warnings[1]


def test_a_server_that_is_silent_is_asked_again_and_again(monkeypatch):
    with server() as running, connection(running.address[1]) as (source, _):
        sent, now = [], [time.monotonic()]
        monkeypatch.setattr(source, "_send", lambda number, text="": sent.append(number))
        monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
        source._wants_names = True
        for _ in range(80):
            now[0] += 0.05
            source._send_requests()
        monkeypatch.undo()
    count = Counter(sent)
    # In 4 s.
    assert 7 <= count[natnet.CONNECT] <= 8
    assert 3 <= count[natnet.KEEP_ALIVE] <= 4
    assert count[natnet.REQUEST_MODEL] == 2
