"""Bags of ROS 2: sqlite3 and MCAP."""

import json
import sqlite3
import struct
import subprocess
import sys
from random import Random

import bags
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin
from rosbags.typesys import get_types_from_msg

from crazyflie_reports import bag_file, bag_ros2
from crazyflie_reports.bag_file import BagError
from crazyflie_reports.bag_flights import flights, vehicles
from crazyflie_reports.bag_log import read
from crazyflie_reports.bag_report import main, make

MCAP, SQLITE3 = StoragePlugin.MCAP, StoragePlugin.SQLITE3
ZSTD = CompressionFormat.ZSTD
STORAGES = [
    (MCAP, None),
    (MCAP, (CompressionMode.STORAGE, ZSTD)),
    (MCAP, (CompressionMode.MESSAGE, ZSTD)),
    (SQLITE3, None),
    (SQLITE3, (CompressionMode.FILE, ZSTD)),
    (SQLITE3, (CompressionMode.MESSAGE, ZSTD)),
]


@pytest.mark.parametrize(("storage", "compression"), STORAGES)
@pytest.mark.parametrize("is_folder", [True, False])
def test_a_flight_of_crazyswarm2(tmp_path, storage, compression, is_folder):
    with bags.ros2_bag(tmp_path / "a", storage, compression) as write:
        bags.write_crazyswarm2(write)
    (file,) = set((tmp_path / "a").iterdir()) - {tmp_path / "a" / "metadata.yaml"}
    (log,) = read(tmp_path / "a" if is_folder else file, tmp_path)
    assert log.remarks == []
    (flight,) = flights(log)
    assert flight.vehicle.name == "cf1"
    assert flight.record.state.column("z").max() == pytest.approx(1.0 + bags.OFFSET)
    assert flight.record.reference.values[-1, :3] == pytest.approx([0.0, 0.0, 1.0])
    assert flight.during(flight.vehicle.battery)[:, 1] == pytest.approx([3.9])
    assert flight.vehicle.is_driven
    assert [(each.kind.value, each.text) for each in flight.events] == [
        ("warning", "/cf1/link: latency is high"),
    ]  # fmt: skip
    # From 0.1 m on, up to 1.004 m in 2 s and down in 3.3 s.
    assert flight.end - flight.start == pytest.approx(bags.LAND + 3.0 - bags.TAKEOFF - 0.2, abs=0.1)


def test_poses_of_motion_capture_alone(tmp_path):
    with bags.ros2_bag(tmp_path / "a") as write:
        bags.write_crazyswarm2(write, poses="poses")
    (log,) = read(tmp_path / "a", tmp_path)
    (vehicle,) = [each for each in vehicles(log) if len(each.attitude)]
    assert vehicle.name == "cf1"
    assert vehicle.attitude[:, 3].max() == pytest.approx(1.0 + bags.OFFSET)


@pytest.mark.parametrize("storage", [MCAP, SQLITE3])
def test_a_definition_in_a_bag_runs_nothing(tmp_path, monkeypatch, storage):
    bag_ros2.types()
    trace = tmp_path / "trace"
    code = f"__import__('pathlib').Path('{trace}').touch()"
    text = f"float32 data\nfloat32 X={code}\nuint8 y[{code}]\n"
    with bags.ros2_bag(tmp_path / "a", storage, None, {"std_msgs/Float32": text}) as write:
        bags.write_crazyswarm2(write)
        write("/cf1/battery", "std_msgs/Float32", (), 5.0)
    registered = []
    monkeypatch.setattr(
        type(bag_ros2.types()), "register", lambda self, each: registered.append(each)
    )
    (log,) = read(tmp_path / "a", tmp_path)
    assert any("/cf1/battery is omitted: std_msgs/msg/Float32" in each for each in log.remarks)
    assert registered == []
    assert not trace.exists()


def test_a_type_with_other_fields_is_left_out(tmp_path):
    text = "std_msgs/Header header\nfloat32 voltage\n"
    with bags.ros2_bag(tmp_path / "a", MCAP, None, {"crazyflie_interfaces/Status": text}) as write:
        bags.write_crazyswarm2(write)
    (log,) = read(tmp_path / "a", tmp_path)
    (remark,) = log.remarks
    assert "/cf1/status is omitted: crazyflie_interfaces/msg/Status has the fields" in remark
    assert len(list(flights(log))) == 1


@pytest.mark.parametrize(
    ("storage", "compression"), [each for each in STORAGES if each[1] is not None]
)
def test_what_expands_to_more_than_memory_holds(tmp_path, monkeypatch, storage, compression):
    with bags.ros2_bag(tmp_path / "a", storage, compression) as write:
        bags.write_crazyswarm2(write)
    monkeypatch.setattr(bag_file, "LARGEST_CHUNK", 30)
    with pytest.raises(BagError, match="expands to more than"):
        read(tmp_path / "a", tmp_path)


def test_a_chunk_that_only_the_index_has_is_not_decompressed(tmp_path):
    with bags.ros2_bag(tmp_path / "a", MCAP, (CompressionMode.STORAGE, ZSTD)) as write:
        bags.write_crazyswarm2(write)
    file = tmp_path / "a" / "a.mcap"
    data = bytearray(file.read_bytes())
    # Behind magic and header is the first chunk; its record says where it is, and how long.
    (header,) = struct.unpack_from("<Q", data, 9)
    begin = 17 + header
    (size,) = struct.unpack_from("<Q", data, begin + 1)
    place = data.rindex(struct.pack("<QQ", begin, 9 + size))
    struct.pack_into("<Q", data, place, begin + 100)
    file.write_bytes(data)
    with pytest.raises(BagError, match="its index has a chunk that is not in the file"):
        read(file, tmp_path)


@pytest.mark.parametrize(("storage", "compression"), STORAGES)
def test_whatever_is_damaged_is_read_in_part_or_refused(tmp_path, storage, compression):
    with bags.ros2_bag(tmp_path / "a", storage, compression) as write:
        bags.write_crazyswarm2(write, end=3.0)
    (file,) = set((tmp_path / "a").iterdir()) - {tmp_path / "a" / "metadata.yaml"}
    whole, random = file.read_bytes(), Random(1)
    refusals = 0
    for number in range(40):
        (tmp_path / str(number)).mkdir()
        data = bytearray(whole)
        for _ in range(random.choice((1, 3, 20))):
            # More often where headers and index are.
            place = random.choice((random.randrange(len(data)), random.randrange(400), -1))
            place -= random.randrange(400) if place < 0 else 0
            data[place] = random.choice((0, 255, random.randrange(256)))
        file.write_bytes(data)
        try:
            for log in read(file, tmp_path / str(number)):
                list(flights(log))
        except BagError as error:
            assert str(file) in str(error)
            refusals += 1
    assert 0 < refusals < 40


@pytest.mark.parametrize("storage", [MCAP, SQLITE3])
@pytest.mark.parametrize("share", [0.0, 0.001, 0.5])
def test_a_file_that_breaks_off(tmp_path, storage, share):
    with bags.ros2_bag(tmp_path / "a", storage) as write:
        bags.write_crazyswarm2(write)
    (file,) = set((tmp_path / "a").iterdir()) - {tmp_path / "a" / "metadata.yaml"}
    file.write_bytes(file.read_bytes()[: round(share * file.stat().st_size)])
    try:
        logs = read(file, tmp_path)
    except BagError as error:
        assert str(file) in str(error)
        assert ("mcap recover" in str(error)) == (storage is MCAP)
    else:
        assert file.name in logs[0].remarks[0]


def test_messages_that_are_too_short_are_counted(tmp_path):
    with bags.ros2_bag(tmp_path / "a", SQLITE3) as write:
        bags.write_crazyswarm2(write)
    file = next((tmp_path / "a").glob("*.db3"))
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE messages SET data = substr(data, 1, 20) WHERE id < 11")
    (log,) = read(file, tmp_path)
    assert any(each.startswith("10 messages of /cf1/pose") for each in log.remarks)


def test_a_sequence_that_claims_more_than_there_is(tmp_path):
    with bags.ros2_bag(tmp_path / "a", SQLITE3) as write:
        bags.write_crazyswarm2(write, poses="poses")
    file = next((tmp_path / "a").glob("*.db3"))
    with sqlite3.connect(file) as connection:
        ((data,),) = connection.execute("SELECT data FROM messages WHERE id = 1")
        place = data.index(struct.pack("<I", 1), 16)
        data = data[:place] + struct.pack("<I", 1 << 31) + data[place + 4 :]
        connection.execute("UPDATE messages SET data = ? WHERE id = 1", (data,))
    (log,) = read(file, tmp_path)
    assert any(each.startswith("1 messages of /poses") for each in log.remarks)


def test_the_foreign_definitions_parse():
    for name, text in bag_ros2.FOREIGN.items():
        fields = get_types_from_msg(text, bag_ros2.ros2_name(name))[bag_ros2.ros2_name(name)][1]
        assert len(fields) == text.count("\n")


def test_the_dashboard_loads_nothing_of_it():
    code = "import sys, crazyflie_reports.bag_topics; print('rosbags' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "False\n"


def report(folder, name, *arguments):
    """Make a report into a folder of this name; return the figures and the events of its flight."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["flight_report", *arguments, "--out", str(folder / name)])
        assert main() == 0
    (flight,) = json.loads((folder / name / "report.json").read_text())
    return {key: each["value"] for key, each in flight["figures"].items()}, flight["events"]


def test_what_mcap_writes_has_the_flight(tmp_path):
    with bags.written(tmp_path / "a.bag") as bag:
        bags.write_flight(bag, "cf1", gap=(6.0, 6.2), tilt=0.1)
        bags.write_events(bag, "cf1")
    before, events = report(tmp_path, "one", str(tmp_path / "a.bag"), "--mcap")
    after, again = report(tmp_path, "two", str(tmp_path / "one" / "mcap" / "a.bag"))
    # ROS 2 has no numbers in sequence.
    assert (before.pop("states not recorded"), after.pop("states not recorded")) == (19.0, None)
    assert after == {
        name: value and pytest.approx(value, rel=1e-3, abs=1e-3) for name, value in before.items()
    }
    assert [each[0] for each in again] == [each[0] for each in events]
    assert all(event[2] in line[2] for event, line in zip(events, again, strict=True))


def test_what_mcap_writes_has_frames_markers_and_numbers(tmp_path):
    with bags.written(tmp_path / "a.bag") as bag:
        for name in ("cf1", "cf2"):
            bags.write_flight(bag, name)
    make([tmp_path / "a.bag"], tmp_path / "out", has_mcap=True)
    found = {}
    with Reader(tmp_path / "out" / "mcap" / "a.bag" / "a.bag.mcap") as reader:
        for connection, time, data in reader.messages():
            message = bag_ros2.types().deserialize_cdr(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((time * 1e-9 - bags.START, message))
    own = {f"/{name}/{topic}" for name in ("cf1", "cf2") for topic in (
        "state", "ref", "control/final", "in_flight_flight_status", "model", "path", "reference"
    )}  # fmt: skip
    assert set(found) == {"/tf", *own}
    transforms = [each for _, message in found["/tf"] for each in message.transforms]
    frames = {each.child_frame_id for each in transforms} | {transforms[0].header.frame_id}
    assert frames == {"world", "cf1", "cf2"}
    markers = [
        marker
        for topic, messages in found.items()
        for _, message in messages
        for marker in getattr(message, "markers", ())
    ]
    assert {each.header.frame_id for each in markers} == frames
    # Those of a vehicle move with its frame, and can be told apart.
    model = found["/cf2/model"][0][1].markers
    assert {(each.header.frame_id, each.frame_locked) for each in model} == {("cf2", True)}
    assert len({each.id for each in model}) == len(model) == 6
    (path,) = found["/cf1/path"][0][1].markers
    assert max(point.z for point in path.points) == pytest.approx(1.0 + bags.OFFSET)
    at, control = next(each for each in found["/cf1/control/final"] if each[0] > 5.0)
    assert control.control.thrust == pytest.approx(9.81)
    assert control.header.stamp.sec == int(bags.START + at)


def test_mcap_is_written_again_and_only_if_it_is_asked_for(tmp_path):
    bag = bags.flight_bag(tmp_path / "a.bag")
    make([bag], tmp_path / "out")
    assert not (tmp_path / "out" / "mcap").exists()
    for _ in range(2):
        make([bag], tmp_path / "out", has_mcap=True)
    assert [each.name for each in (tmp_path / "out" / "mcap").iterdir()] == ["a.bag"]
