"""Systems behind the motioncapture package, here mostly one that is made up."""

import contextlib
import math
import platform
import signal
import socket
import sys
import time
from pathlib import Path

import pytest

from mocap_optitrack import library_source as module
from mocap_optitrack.library_source import LibrarySource
from mocap_optitrack.source import SourceError

LIMIT = 60.0


@pytest.fixture
def _fake_package(tmp_path, monkeypatch):
    fake = Path(__file__).with_name("fake_motioncapture.py")
    (tmp_path / "motioncapture.py").symlink_to(fake)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    monkeypatch.chdir(tmp_path)


@contextlib.contextmanager
def connection(host, system="vicon", **options):
    """Return an open connection."""
    source = LibrarySource(system, host, time.monotonic, **options)
    try:
        source.open()
        yield source
    finally:
        source.close()


def frames(source):
    """Return all frames until the connection ends, and why it did."""
    received = []
    try:
        while True:
            frame = source.read(LIMIT)
            if frame is not None:
                received.append(frame)
    except SourceError as error:
        return received, str(error)


def seen(frame):
    """Return name and x of the bodies that are tracked."""
    return [(body.name, body.position[0]) for body in frame.bodies if body.is_tracked]


@pytest.mark.usefixtures("_fake_package")
def test_bodies_that_move_are_tracked():
    begin = time.monotonic()
    with connection("127.0.0.1") as source:
        received, end = frames(source)
    assert list(map(seen, received)) == [[("cf1", 2.0)], [("cf1", 3.0), ("still", 6.0)]]
    cf1, still = received[0].bodies
    assert cf1[:4] == (None, "cf1", (2.0, 2.0, 3.0), (0.0, 0.0, 0.0, 1.0))
    assert not still.is_tracked
    assert received[0].exposure is None
    assert begin < received[0].arrival < time.monotonic()
    assert "does not answer" in end


@pytest.mark.usefixtures("_fake_package")
def test_frames_that_repeat_show_no_moving_body():
    with connection("127.0.0.2") as source:
        assert frames(source)[0] == []
        assert "no body that moves" in source.silence_hint


@pytest.mark.usefixtures("_fake_package")
def test_frames_that_have_waited_are_as_old_as_they_are():
    with connection("127.0.0.1") as source:
        source._worker.wait(LIMIT)
        ended = time.monotonic()
        received, _ = frames(source)
    assert len(received) == 2
    for frame in received:
        assert frame.arrival >= ended
        assert frame.arrival - frame.waited < ended


@pytest.mark.usefixtures("_fake_package")
def test_a_reader_that_stands_still_does_not_hold_up_the_system(tmp_path):
    with connection("127.0.0.6") as source:
        assert source._worker.wait(LIMIT) == -signal.SIGALRM
        assert (tmp_path / "done").exists()
        received, _ = frames(source)
    # More than the pipe holds: the newest are missing, and no line is broken.
    numbers = [frame.bodies[0].position[0] for frame in received]
    assert 0 < len(numbers) < 20000
    assert numbers == sorted(numbers)


@pytest.mark.usefixtures("_fake_package")
def test_what_is_not_a_number_comes_through():
    with connection("127.0.0.5") as source:
        (frame,), _ = frames(source)
    assert math.isnan(frame.bodies[0].position[0])


@pytest.mark.usefixtures("_fake_package")
def test_a_system_that_refuses():
    text = "vicon at 127.0.0.3: vicon is not at home"
    with pytest.raises(SourceError, match=text), connection("127.0.0.3"):
        pass


@pytest.mark.usefixtures("_fake_package")
def test_a_system_that_hangs_with_the_interpreters_lock_is_killed():
    text = "vicon at 127.0.0.4 does not answer: is it running"
    begin = time.monotonic()
    with pytest.raises(SourceError, match=text), connection("127.0.0.4"):
        pass
    assert time.monotonic() - begin < LIMIT


@pytest.mark.usefixtures("_fake_package")
def test_closing_ends_the_process():
    with connection("127.0.0.2") as source:
        worker = source._worker
    assert worker.returncode is not None


def test_a_host_that_is_unknown(monkeypatch):
    def resolve(host):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "gethostbyname", resolve)
    text = "hostname 'vicon-pc' is unknown: .* not known"
    with pytest.raises(SourceError, match=text), connection("vicon-pc"):
        pass


def test_without_the_package(tmp_path, monkeypatch):
    (tmp_path / "motioncapture.py").write_text("raise ImportError('no binary for this machine')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    text = "vicon at 127.0.0.1: the motioncapture package .* is missing: no binary for this machine"
    with pytest.raises(SourceError, match=text), connection("127.0.0.1"):
        pass


@pytest.mark.skipif(
    platform.machine() != "x86_64" or sys.version_info >= (3, 14),
    reason="the package has no other binaries",
)
def test_the_real_package_has_these_systems():
    from motioncapture import connect

    with pytest.raises(RuntimeError, match="Unknown motion capture type"):
        connect("nothing", {})
    # Without a server this one fails at once, where vicon would hang and vrpn go on.
    text = "qualisys at 127.0.0.1: Error connecting"
    with pytest.raises(SourceError, match=text), connection("127.0.0.1", "qualisys"):
        pass
    assert set(module.SYSTEMS) == {"vicon", "qualisys", "vrpn"}


@pytest.mark.usefixtures("_fake_package")
def test_unlabelled_markers_are_told_when_they_are_new():
    with connection("127.0.0.7", needs_points=True) as source:
        received, _ = frames(source)
    assert [frame.points for frame in received] == [((1.0, 0.5, 1.0),), ((2.0, 0.5, 1.0),)]


@pytest.mark.usefixtures("_fake_package")
def test_a_package_without_unlabelled_markers_is_refused_where_they_are_needed():
    with pytest.raises(SourceError, match="sends no unlabelled markers of vicon"):
        with connection("127.0.0.1", needs_points=True):
            pass
