"""MCAP files with messages of ROS 1, as ``mcap convert`` makes them of bags."""

import re
import struct
import tempfile
import zlib
from pathlib import Path
from random import Random

import bags
import lz4.frame
import pytest
import rosbag
from backports import zstd

from crazyflie_reports import bag_file
from crazyflie_reports.bag_file import BagError
from crazyflie_reports.bag_flights import flights
from crazyflie_reports.bag_log import read
from crazyflie_reports.bag_report import make

MAGIC = b"\x89MCAP0\r\n"
COMPRESS = {"": bytes, "zstd": zstd.compress, "lz4": lz4.frame.compress}


def text(value):
    """Return a text as MCAP has it."""
    return struct.pack("<I", len(value.encode())) + value.encode()


def record(kind, *parts):
    """Return a record of MCAP."""
    data = b"".join(parts)
    return struct.pack("<BQ", kind, len(data)) + data


def convert(
    bag, path, compression="", profile="ros1", encoding="ros1", md5=True, change=str, summed="file"
):
    """Write the messages of a bag as MCAP, 200 in a chunk; ``change`` alters the definitions.

    ``summed`` is what the check sum at the end is of: "file", "data" (without the header) or "".
    """
    parts, messages, numbers = [MAGIC, record(1, text(profile), text("a test"))], [], {}

    def end_chunk():
        content = b"".join(messages)
        packed = COMPRESS[compression](content)
        head = struct.pack("<QQQI", 0, 0, len(content), zlib.crc32(content)) + text(compression)
        parts.append(record(6, head, struct.pack("<Q", len(packed)), packed))
        messages.clear()

    with rosbag.Bag(bag) as source:
        for topic, (name, data, md5sum, _, kind), time in source.read_messages(raw=True):
            if topic not in numbers:
                number = numbers[topic] = len(numbers) + 1
                schema = struct.pack("<H", number) + text(name) + text("ros1msg")
                messages.append(record(3, schema, text(change(kind._full_text))))
                pairs = text("md5sum") + text(md5sum) if md5 else b""
                channel = struct.pack("<HH", number, number) + text(topic) + text(encoding)
                messages.append(record(4, channel, struct.pack("<I", len(pairs)) + pairs))
            stamp = time.to_nsec()
            messages.append(record(5, struct.pack("<HIQQ", numbers[topic], 0, stamp, stamp), data))
            if len(messages) >= 200:
                end_chunk()
    end_chunk()
    skipped = {"file": 0, "data": 2, "": len(parts)}[summed]
    checksum = zlib.crc32(b"".join(parts[skipped:]))
    parts += [
        record(0x0F, struct.pack("<I", checksum)),
        record(2, struct.pack("<QQI", 0, 0, 0)),
        MAGIC,
    ]
    path.write_bytes(b"".join(parts))
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp("bag") / "a.bag"
    with rosbag.Bag(path, "w") as file:
        bags.write_flight(file, "cf1")
    return path


@pytest.fixture
def load(tmp_path):
    """Return a function that reads a recording, with a folder of its own for its series."""

    def load(path):
        (log,) = read(path, Path(tempfile.mkdtemp(dir=tmp_path)))
        return log

    return load


@pytest.mark.parametrize("compression", COMPRESS)
def test_a_flight_is_that_of_the_bag(tmp_path, bag, load, compression):
    folder = tmp_path / "recording"
    folder.mkdir()
    file = convert(bag, folder / "a.mcap", compression)
    (expected,) = flights(load(bag))
    for path in (file, folder):
        log = load(path)
        assert log.remarks == []
        (flight,) = flights(log)
        assert flight.vehicle.name == "cf1"
        assert (flight.start, flight.end) == pytest.approx((expected.start, expected.end))
        assert flight.record.state.values.tolist() == expected.record.state.values.tolist()
    assert make([file], tmp_path / "report") == []


def test_without_md5_sums_definitions_are_compared(tmp_path, bag, load):
    def commented(definition):
        return "# A comment.\n\n" + re.sub("float64 +z ", "float64   z # up,", definition)

    log = load(convert(bag, tmp_path / "a.mcap", md5=False, change=commented))
    assert log.remarks == []
    assert len([*flights(log)]) == 1

    def swapped(definition):
        return re.sub(r"(float64 x .*\n)(float64 y .*\n)", r"\2\1", definition)

    log = load(convert(bag, tmp_path / "a.mcap", md5=False, change=swapped))
    assert [text for text in log.remarks if "/cf1/state is omitted: its crazyflie_msgs" in text]
    assert "/cf1/state" not in log.sources


def test_messages_of_another_encoding_are_named(tmp_path, bag, load):
    file = convert(bag, tmp_path / "a.mcap", profile="", encoding="json")
    with pytest.raises(BagError, match="/cf1/state is omitted: its encoding is json; expected"):
        load(file)


def test_ros_2_without_its_profile_is_read(tmp_path, load):
    with bags.ros2_bag(tmp_path / "a") as write:
        bags.write_crazyswarm2(write)
    data = (tmp_path / "a" / "a.mcap").read_bytes()
    file = tmp_path / "b.mcap"
    file.write_bytes(data.replace(text("ros2"), text("none"), 1))
    log = load(file)
    assert log.remarks == []
    assert [flight.vehicle.name for flight in flights(log)] == ["cf1"]


def test_a_file_that_is_compressed_as_a_whole_is_read(tmp_path, bag, load):
    data = convert(bag, tmp_path / "a.mcap").read_bytes()
    whole = load(tmp_path / "a.mcap").sources["/cf1/state"].rows().tolist()
    file = tmp_path / "a.mcap.zstd"
    file.write_bytes(zstd.compress(data))
    log = load(file)
    assert log.remarks == []
    assert log.sources["/cf1/state"].rows().tolist() == whole
    file.write_bytes(zstd.compress(data)[:-1000])
    log = load(file)
    assert any("a.mcap.zstd breaks off at" in text for text in log.remarks)
    some = log.sources["/cf1/state"].rows().tolist()
    assert 0 < len(some) < len(whole)
    file.write_bytes(b"no zstd at all")
    with pytest.raises(BagError, match="a.mcap.zstd cannot be read: "):
        load(file)


@pytest.mark.parametrize("compression", COMPRESS)
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_file_that_is_cut_is_read_as_far_as_it_goes(tmp_path, bag, load, compression, share):
    whole = load(convert(bag, tmp_path / "a.mcap", compression))
    data = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "a.mcap").write_bytes(data[: round(share * len(data))])
    log = load(tmp_path / "a.mcap")
    assert any("a.mcap breaks off at" in text for text in log.remarks)
    some, every = (each.sources["/cf1/state"].rows().tolist() for each in (log, whole))
    assert 0 < len(some) <= len(every)
    assert some == every[: len(some)]


@pytest.mark.parametrize("summed", ["file", "data", ""])
@pytest.mark.parametrize("compression", COMPRESS)
def test_a_file_that_is_whole_has_the_check_sums_of_its_writer(
    tmp_path, bag, load, compression, summed
):
    assert load(convert(bag, tmp_path / "a.mcap", compression, summed=summed)).remarks == []


@pytest.mark.parametrize("summed", ["file", "data", ""])
def test_a_number_that_was_changed_is_named_and_not_shown(tmp_path, bag, load, summed):
    file = convert(bag, tmp_path / "a.mcap", summed=summed)
    whole, data = load(file).sources["/cf1/state"].rows().tolist(), bytearray(file.read_bytes())
    # A byte of a message in the middle.
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    log = load(file)
    assert "a chunk does not have the check sum that was written" in log.remarks[0]
    some = log.sources["/cf1/state"].rows().tolist()
    assert 0 < len(some) < len(whole)
    assert some == whole[: len(some)]


@pytest.mark.parametrize("summed", ["file", "data"])
def test_a_number_that_was_changed_outside_chunks_is_named(tmp_path, bag, load, summed):
    file = convert(bag, tmp_path / "a.mcap", summed=summed)
    data = file.read_bytes()
    begin = len(MAGIC) + len(record(1, text("ros1"), text("a test")))
    # The time at which its first chunk begins.
    file.write_bytes(data[: begin + 9] + b"\1" + data[begin + 10 :])
    assert (
        load(file)
        .remarks[0]
        .endswith("is damaged: its data does not have the check sum that was written")
    )


def test_a_file_without_messages_is_named(tmp_path, load):
    file = tmp_path / "a.mcap"
    file.write_bytes(MAGIC + record(1, text("ros1"), text("")) + record(2, bytes(20)) + MAGIC)
    with pytest.raises(BagError, match="a.mcap has no messages; expected"):
        load(file)


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_what_expands_to_more_than_memory_holds(tmp_path, bag, load, monkeypatch, compression):
    monkeypatch.setattr(bag_file, "LARGEST_CHUNK", 30)
    with pytest.raises(BagError, match="expands to more than"):
        load(convert(bag, tmp_path / "a.mcap", compression))


@pytest.mark.parametrize("compression", COMPRESS)
def test_whatever_is_damaged_is_read_in_part_or_refused(tmp_path, bag, compression):
    file, random = convert(bag, tmp_path / "a.mcap", compression), Random(1)
    whole = file.read_bytes()
    for number in range(40):
        (tmp_path / str(number)).mkdir()
        data = bytearray(whole)
        for _ in range(random.choice((1, 3, 20))):
            # More often where schemas and channels are.
            place = random.choice((random.randrange(len(data)), random.randrange(3000)))
            data[place] = random.choice((0, 255, random.randrange(256)))
        file.write_bytes(data)
        try:
            for log in read(file, tmp_path / str(number)):
                list(flights(log))
        except BagError as error:
            assert str(file) in str(error)
