"""Bags that break off, that are not bags, and those that are too long for memory."""

import struct

import bags
import numpy as np
import pytest
import rosbag
from std_msgs.msg import Float32, String

from crazyflie_msgs.msg import ControlStamped
from crazyflie_reports import bag_file
from crazyflie_reports.bag_file import MAGIC, BagError, BagFile
from crazyflie_reports.bag_log import Spool, read
from crazyflie_reports.bag_report import ReportError, make
from crazyflie_reports.report_page import decimated


def times(path):
    """Return the times of all messages, and why reading ended early."""
    file = BagFile(path)
    return [time for _, time, _ in file.messages(lambda connection: True)], file.interruption


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_a_bag_that_breaks_off_is_read_as_far_as_it_goes(tmp_path, compression):
    whole = bags.flight_bag(tmp_path / "whole.bag", compression)
    every, reason = times(whole)
    assert len(every) > 3000
    assert reason == ""
    part = tmp_path / "part.bag"
    part.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    some, reason = times(part)
    assert 0 < len(some) < len(every)
    assert some == every[: len(some)]
    assert "part.bag breaks off at" in reason
    make([part], tmp_path / "out")
    assert "part.bag breaks off at" in (tmp_path / "out" / "report.html").read_text()


def test_a_bag_without_index(tmp_path):
    whole = bags.flight_bag(tmp_path / "whole.bag")
    every, _ = times(whole)
    data = whole.read_bytes()
    place = data.index(b"index_pos=") + len(b"index_pos=")
    (end,) = struct.unpack_from("<Q", data, place)
    active = tmp_path / "crash.bag.active"
    active.write_bytes(data[:place] + bytes(8) + data[place + 8 : end])
    some, reason = times(active)
    assert some == every
    assert "crash.bag.active was not closed" in reason


@pytest.mark.parametrize(("is_sized", "share"), [(False, 1.0), (False, 0.5), (True, 0.5)])
def test_a_chunk_that_was_not_closed(tmp_path, is_sized, share):
    whole = bags.flight_bag(tmp_path / "whole.bag")
    every, _ = times(whole)
    data = bytearray(whole.read_bytes())
    place = data.index(b"compression=none")
    # Behind the header of the first chunk is its size; 0 while it is written.
    place = data.index(b"size=", place) + len(b"size=") + 4
    (size,) = struct.unpack_from("<I", data, place)
    if not is_sized:
        data[place : place + 4] = bytes(4)
    part = tmp_path / "part.bag"
    part.write_bytes(data[: place + 4 + round(share * size)])
    some, reason = times(part)
    assert some == every[: len(some)]
    assert some
    assert ("it ends within" if share < 1.0 else "its last chunk was not closed") in reason


def test_damage(tmp_path):
    whole = bags.flight_bag(tmp_path / "whole.bag")
    data = whole.read_bytes()
    half = len(data) // 2
    whole.write_bytes(data[:half] + bytes([255]) * 200_000 + data[half:])
    some, reason = times(whole)
    assert some
    assert "breaks off" in reason


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
@pytest.mark.parametrize(
    ("limits", "text"),
    [
        ({"LARGEST_CHUNK": 50_000}, "a chunk expands to more than"),
        ({"LEAST_TOTAL": 0, "LARGEST_RATIO": 1}, "its chunks expand to more than"),
    ],
)
def test_chunks_that_expand_to_more_than_memory_or_disk_hold(
    tmp_path, monkeypatch, compression, limits, text
):
    whole = bags.flight_bag(tmp_path / "whole.bag", compression)
    every, _ = times(whole)
    for name, value in limits.items():
        monkeypatch.setattr(bag_file, name, value, raising=False)
    some, reason = times(whole)
    assert len(some) < len(every)
    assert some == every[: len(some)]
    assert text in reason


def other_md5(bag):
    """Write controls of another definition."""

    class Other(ControlStamped):
        _md5sum = "0123456789abcdef0123456789abcdef"

    bag.write("/control/final", Other(), bags.stamp(1.0))


@pytest.mark.parametrize(
    ("write", "complaints"),
    [
        (
            lambda bag: None,
            ["no messages", "state (crazyflie_msgs/PositionVelocityYawStateStamped"],
        ),
        (
            lambda bag: bag.write("/chat", String("hello"), bags.stamp(1.0)),
            ["no topics of a flight", "control/final", "There are: /chat (std_msgs/String)"],
        ),
        (other_md5, ["/control/final", "0123456789abcdef", "e85f24c467a6496a2e0c3b92ff0fe75d"]),
    ],
)
def test_a_bag_without_our_topics(tmp_path, write, complaints):
    path = tmp_path / "a.bag"
    with bags.written(path) as bag:
        write(bag)
    with pytest.raises(BagError) as error:
        read(path, tmp_path)
    for complaint in complaints:
        assert complaint in str(error.value)


def test_a_definition_in_a_bag_runs_nothing(tmp_path):
    trace = tmp_path / "trace"

    class Hostile(Float32):
        _full_text = (
            f"int8 __module__;__import__('pathlib').Path('{trace}').touch();B=1\nfloat32 data\n"
        )

    path = bags.flight_bag(tmp_path / "a.bag")
    with rosbag.Bag(str(path), "a") as bag:
        bag.write("/battery", Hostile(data=3.7), bags.stamp(5.0))
    (log,) = read(path, tmp_path)
    assert log.sources["/battery"].rows()[0, -1] == pytest.approx(3.7)
    assert not trace.exists()


def test_a_type_without_a_local_definition_is_left_out(tmp_path):
    class Unknown(Float32):
        _type = "dynamic_reconfigure/Config"
        _md5sum = "*"

    path = bags.flight_bag(tmp_path / "a.bag")
    with rosbag.Bag(str(path), "a") as bag:
        bag.write("/lqr_controller/parameter_updates", Unknown(), bags.stamp(5.0))
    (log,) = read(path, tmp_path)
    assert any("/lqr_controller/parameter_updates is omitted" in each for each in log.remarks)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"", "is empty"),
        (b"hello\n", "is not a bag: it begins with b'hello"),
        (b"#ROSBAG V1.2\n", "has the format ROSBAG V1.2; run rosbag fix"),
        (MAGIC, "has no messages"),
        (None, "does not exist"),
    ],
)
def test_what_is_no_bag(tmp_path, content, complaint):
    path = tmp_path / "a.bag"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ReportError, match=f"a.bag.*{complaint}"):
        make([path], tmp_path / "out")


def test_a_folder_without_bags(tmp_path):
    with pytest.raises(ReportError, match=r"expected the folder of a recording"):
        make([tmp_path], tmp_path / "out")


def test_a_folder_that_cannot_be_written(tmp_path):
    bag = bags.flight_bag(tmp_path / "a.bag")
    with pytest.raises(ReportError, match=r"cannot be written into .*a.bag"):
        make([bag], bag)


def test_a_spool_gives_back_what_it_has_put_on_disk(tmp_path):
    path = tmp_path / "rows"
    spool = Spool(path, ("x", "y"))
    for number in range(5000):
        spool.append(number * 0.01, 0.0, number, (number, -number))
    rows = spool.rows()
    assert rows.shape == (5000, 5)
    assert path.stat().st_size > 100_000
    np.testing.assert_array_equal(rows[:, 3], np.arange(5000))


def test_rows_are_in_the_order_of_their_times(tmp_path):
    spool = Spool(tmp_path / "rows", ("x",))
    for time in (2.0, 1.0, 3.0):
        spool.append(time, 0.0, 0, (10.0 * time,))
    np.testing.assert_array_equal(spool.rows()[:, [0, 3]], [[1, 10], [2, 20], [3, 30]])


def test_decimation_keeps_peaks():
    moments = np.arange(100_000.0)
    values = np.zeros_like(moments)
    values[77_777] = 5.0
    kept, peaks = decimated(moments, values, 200)
    assert len(kept) <= 200
    assert kept[peaks.argmax()] == 77_777
    assert (np.diff(kept) > 0).all()


def test_chunks_within_chunks_are_damage(tmp_path):
    data = b""
    for _ in range(3000):
        fields = [b"op=\x05", b"compression=none", b"size=" + struct.pack("<I", len(data))]
        header = b"".join(struct.pack("<I", len(each)) + each for each in fields)
        size = struct.pack("<I", len(data))
        data = struct.pack("<I", len(header)) + header + size + data
    path = tmp_path / "a.bag"
    path.write_bytes(MAGIC + data)
    assert "it is damaged" in times(path)[1]
