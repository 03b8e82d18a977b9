"""The NatNet server, and the observations that it shows."""

import contextlib
import math
import socket
import threading
import time

import pytest
from natnet import NatNetClient

from crazyflie_virtual.mocap import MocapScene, MocapServer, MocapSettings
from crazyflie_virtual.natnet import Encoder
from crazyflie_virtual.server import Observation, VehicleServer
from crazyflie_virtual.settings import VehicleSettings

LIMIT = 60.0


class Watcher:
    """A client, and the latest of what it hears."""

    def __init__(self, client):
        self.client = client
        self.frames = []
        self.model = None
        self._received = threading.Condition()
        client.on_data_frame_received_event.handlers.append(self._on_frame)
        client.on_data_description_received_event.handlers.append(self._on_model)

    def _on_frame(self, frame):
        with self._received:
            self.frames.append(frame)
            self._received.notify()

    def _on_model(self, model):
        with self._received:
            self.model = model
            self._received.notify()

    def wait(self, condition):
        """Wait until ``condition()`` holds."""
        with self._received:
            assert self._received.wait_for(condition, LIMIT)

    def wait_for_body(self, condition):
        """Return a body of a later frame for which ``condition(body)`` holds."""
        seen = len(self.frames)

        def found():
            return [b for f in self.frames[seen:] for b in f.rigid_bodies if condition(b)]

        self.wait(found)
        return found()[0]


@pytest.mark.parametrize("rate", [math.inf, math.nan])
def test_a_body_whose_rates_are_no_numbers_ends_nothing(rate):
    scene = MocapScene(MocapSettings())
    still, upright = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    for number, rates in ((1, (0.0, rate, 0.0)), (2, still)):
        scene.observe(Observation(number, f"cf{number}", 10.0, still, still, upright, rates))
    wild, good = scene.bodies(10.01)
    assert all(map(math.isnan, wild.quaternion))
    assert good.quaternion == pytest.approx(upright)


@pytest.mark.parametrize("number", [math.inf, math.nan, 1e39, -1e300])
@pytest.mark.parametrize("markers", ["", "1"])
def test_a_pose_that_is_too_large_for_the_stream_ends_nothing(number, markers):
    scene = MocapScene(MocapSettings(single_markers=markers))
    still, upright = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    wild = (number, 0.0, 0.0), (0.0, number, 0.0), (0.0, 0.0, 0.0, number), still
    for body_id, state in ((1, wild), (2, (still, still, upright, still))):
        scene.observe(Observation(body_id, f"cf{body_id}", 10.0, *state))
    bodies = scene.bodies(10.01)
    Encoder("3.0").frame(1, bodies, 10.0, 10.0, 10.0, scene.markers(10.01))
    assert bodies[-1].quaternion == pytest.approx(upright)


@pytest.fixture
def watch():
    """Return ``watch(**options)``: a motion capture system, and a client that hears it."""
    with contextlib.ExitStack() as stack:

        def watch(**options):
            settings = MocapSettings(command_port=0, observer_port=0, **options)
            server = MocapServer(settings)
            stack.callback(server.stop)
            server.start()
            client = NatNetClient(
                command_port=server.address[1],
                use_multicast=settings.multicast,
                multicast_address=settings.multicast_address,
                data_port=settings.data_port,
            )
            watcher = Watcher(client)
            client.connect(timeout=LIMIT)
            stack.callback(client.shutdown)
            client.run_async()
            return server, watcher

        yield watch


@pytest.fixture
def vehicle():
    """Return ``vehicle(server, **options)``, which starts a vehicle that a server sees."""
    with contextlib.ExitStack() as stack:

        def vehicle(server, **options):
            settings = VehicleSettings(port=0, observer_port=server.observer_port, **options)
            virtual = VehicleServer(settings)
            stack.callback(virtual.stop)
            virtual.start()
            return virtual

        yield vehicle


@pytest.mark.parametrize("version", ["2.9", "3.1", "4.1"])
def test_unicast_client_sees_the_vehicles(watch, vehicle, version):
    server, watcher = watch(version=version)
    vehicle(server, body_id=3, body_name="alice", init_x=1.5)
    vehicle(server, body_id=8, init_y=-2.0)
    watcher.wait(lambda: watcher.frames and len(watcher.frames[-1].rigid_bodies) == 2)
    alice, bob = watcher.frames[-1].rigid_bodies
    assert (alice.id_num, alice.pos, alice.tracking_valid) == (3, (1.5, 0.0, 0.0), True)
    assert (bob.id_num, bob.pos) == (8, (0.0, -2.0, 0.0))
    watcher.client.request_modeldef()
    watcher.wait(lambda: watcher.model is not None)
    assert [b.name for b in watcher.model.rigid_bodies][0] == "alice"
    assert str(watcher.client.server_info.nat_net_protocol_version) == f"{version}.0.0"


def test_multicast_client_sees_the_vehicles(watch, vehicle):
    server, watcher = watch(multicast=True, data_port=15411)
    vehicle(server, body_id=3, init_x=1.5)
    assert watcher.wait_for_body(lambda b: b.id_num == 3).pos == (1.5, 0.0, 0.0)


def test_frames_are_numbered_and_stamped_in_step(watch):
    _, watcher = watch(rate=200.0)
    watcher.wait(lambda: len(watcher.frames) >= 40)
    frames = watcher.frames[:40]
    numbers = [f.prefix.frame_number for f in frames]
    assert numbers == sorted(set(numbers))
    first, last = frames[0], frames[-1]
    elapsed = last.suffix.timestamp - first.suffix.timestamp
    # A busy machine may leave out frames; it does not move them.
    assert elapsed == pytest.approx((numbers[-1] - numbers[0]) / 200.0, abs=1e-6)


def test_latency_is_between_exposure_and_dispatch(watch):
    _, watcher = watch(latency=0.05)
    watcher.wait(lambda: len(watcher.frames) >= 5)
    for frame in watcher.frames:
        suffix = frame.suffix
        assert suffix.stamp_transmit - suffix.stamp_camera_mid_exposure >= 49_999_000


def test_switches(watch, vehicle):
    server, watcher = watch()
    vehicle(server, body_id=3)
    watcher.wait_for_body(lambda b: b.tracking_valid)
    server.switches.invalid = "3"
    watcher.wait_for_body(lambda b: not b.tracking_valid)
    server.switches.invalid = ""
    watcher.wait_for_body(lambda b: b.tracking_valid)


def test_a_vehicle_that_ends_is_no_longer_tracked(watch, vehicle):
    server, watcher = watch()
    virtual = vehicle(server, body_id=3)
    watcher.wait_for_body(lambda b: b.tracking_valid)
    virtual.stop()
    watcher.wait_for_body(lambda b: not b.tracking_valid)


def test_a_port_that_is_taken(watch):
    server, _ = watch()
    with pytest.raises(OSError, match="Address already in use"):
        MocapServer(MocapSettings(command_port=server.address[1], observer_port=0))


def test_an_invalid_address():
    with pytest.raises(OSError, match="multicast_address is 'somewhere'; expected an IPv4 address"):
        MocapServer(MocapSettings(command_port=0, observer_port=0, multicast_address="somewhere"))


OBSERVER_LIMIT = 60.0


def test_observations_come_back():
    observation = Observation(
        7, "ünder", 12.5, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (0.0, 0.0, 0.6, 0.8), (7.0, 8.0, 9.0)
    )
    assert Observation.decode(observation.encode()) == observation


def test_rubbish_is_no_observation():
    assert Observation.decode(b"") is None
    assert Observation.decode(bytes(200)) is None


@pytest.mark.parametrize(("port", "name"), [(19850, "cf1"), (19859, "cf10"), (17850, "cf17850")])
def test_names_follow_from_ports(port, name):
    try:
        server = VehicleServer(VehicleSettings(port=port, observer_port=0))
    except OSError:
        pytest.skip(f"port {port} is taken")
    try:
        assert server.observe().name == name
    finally:
        server.stop()


def test_a_vehicle_tells_its_observer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as observer:
        observer.bind(("127.0.0.1", 0))
        observer.settimeout(OBSERVER_LIMIT)
        port = observer.getsockname()[1]
        server = VehicleServer(VehicleSettings(port=0, observer_port=port, body_id=5, init_y=2.0))
        server.start()
        try:
            first, second = (Observation.decode(observer.recv(1024)) for _ in range(2))
        finally:
            server.stop()
    assert (first.body_id, first.position) == (5, (0.0, 2.0, 0.0))
    assert first.time < second.time <= time.monotonic()


@pytest.mark.parametrize("moments", [(0.2999, 0.3001), (0.0048, 0.0051)])
def test_after_a_stall_no_two_observations_have_the_same_time(moments):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as observer:
        observer.bind(("127.0.0.1", 0))
        observer.setblocking(False)
        port = observer.getsockname()[1]
        server = VehicleServer(VehicleSettings(port=0, observer_port=port))
        begin = server.observe().time
        try:
            for moment in moments:
                server._process(begin + moment, [])
        finally:
            server.stop()
        assert Observation.decode(observer.recv(1024)).time == pytest.approx(begin + moments[0])
        with pytest.raises(BlockingIOError):
            observer.recv(1024)
