"""Logs of a vehicle's micro SD card: read as bags are, and laid over one."""

import math
import struct
import zlib

import bags
import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped

from crazyflie_model.angles import (
    quaternion_from_rpy,
    quaternion_from_zyx,
    rpy_from_quaternion,
)
from crazyflie_reports.bag_file import BagError
from crazyflie_reports.usd_log import LONGEST, UsdLogFile
from crazyflie_reports.usd_overlay import PERIOD, position

SWITCHED_ON = 37.25  #: Time of the log at which the flight begins, s.
THRUST = 42000.0
POSE = ("stateEstimate.x(f)", "stateEstimate.y(f)", "stateEstimate.z(f)")
ANGLES = ("stabilizer.roll(f)", "stabilizer.pitch(f)", "stabilizer.yaw(f)")
TARGET = ("ctrltarget.roll(f)", "ctrltarget.pitch(f)", "ctrltarget.yaw(f)", "stabilizer.thrust(f)")


def written(path, kinds, events, version=2):
    """Write a log: of each kind (number, name) its variables, and (number, time in s, values)."""
    data = struct.pack("<BHH", 0xBC, version, len(kinds))
    for (number, name), variables in kinds.items():
        data += struct.pack("<H", number) + name.encode() + b"\0"
        data += struct.pack("<H", len(variables))
        data += b"".join(each.encode() + b"\0" for each in variables)
    layouts = {n: "<" + "".join(each[-2] for each in v) for (n, _), v in kinds.items()}
    for number, time, values in events:
        head = ("<HI", 1e3) if version == 1 else ("<HQ", 1e6)
        data += struct.pack(head[0], number, round(time * head[1]))
        data += struct.pack(layouts[number], *values)
    path.write_bytes(data + struct.pack("<I", zlib.crc32(data)))
    return path


def tilt(time):
    """Return roll and pitch, rad, of a flight that is like no other."""
    roll = 0.08 * math.sin(2.1 * time) + 0.05 * math.sin(5.3 * time + 1.0)
    return roll, 0.06 * math.sin(3.7 * time + 0.4)


def flight(path, version=2, start=SWITCHED_ON, noise=0.0, until=bags.END, angles=tilt):
    """Write the flight of `bags` as the vehicle logs it, at 500 Hz; its pitch is inverted there."""
    errors = noise * np.random.default_rng(7).normal(size=(10_000, 2))
    kinds = {
        (3, "fixedFrequency"): (*POSE, *ANGLES, *TARGET),
        (9, "battery"): ("pm.vbat(f)", "pm.state(b)"),
    }
    events = []
    for k, time in enumerate(np.arange(0.0, until, 0.002)):
        roll, pitch = np.degrees(np.add(angles(time), errors[k]))
        thrust = THRUST if bags.TAKEOFF <= time < bags.LANDED else 0.0
        values = (0.0, 0.0, bags.height(time)[0], roll, -pitch, 90.0, 1.0, -2.0, 3.0, thrust)
        events.append((3, start + time, values))
        if k % 500 == 0:
            events.append((9, start + time, (3.9, 1)))
    return written(path, kinds, events, version)


def rows(path):
    """Return time and row of each event by role."""
    found = {}
    file = UsdLogFile(path)
    for connection, time, row in file.messages(lambda _: True):
        found.setdefault(connection.role.name, []).append((time, row))
    return found, file


@pytest.mark.parametrize("version", [1, 2])
def test_a_log_is_read(tmp_path, version):
    found, file = rows(flight(tmp_path / "log07", version))
    assert file.interruption == ""
    assert len(found["state"]) == 7500
    time, row = found["state"][1500]
    assert time == pytest.approx(SWITCHED_ON + 3.0)
    assert row[:3] == pytest.approx((0.0, 0.0, bags.height(3.0)[0]))
    assert row[6] == pytest.approx(math.pi / 2)
    attitude = rpy_from_quaternion(*quaternion_from_zyx(*tilt(3.0), math.pi / 2))
    assert found["pose"][1500][1][3:] == pytest.approx(attitude, abs=1e-6)
    expected = math.radians(1.0), math.radians(2.0), math.radians(3.0)
    assert found["final_control"][1500][1][:3] == pytest.approx(expected)
    assert found["final_control"][1500][1][3] == pytest.approx(9.4, abs=1.0)
    assert len(found["battery"]) == 15


def test_a_quaternion_is_preferred(tmp_path):
    q = quaternion_from_rpy(0.1, -0.2, 0.3)
    names = tuple(f"stateEstimate.q{each}(f)" for each in "xyzw")
    path = written(
        tmp_path / "log", {(1, "e"): (*names, *ANGLES)}, [(1, 2.0, (*q, 50.0, 50.0, 50.0))]
    )
    ((_, row),) = rows(path)[0]["pose"]
    assert row[3:] == pytest.approx((0.1, -0.2, 0.3), abs=1e-6)
    assert np.isnan(row[:3]).all()


def test_a_report_on_a_log_alone(run):
    status, _, (flown,) = run(flight(run.folder / "log07"))
    assert status == 0
    assert (flown["vehicle"], flown["recording"]) == ("log07", "log07")
    html = (run.folder / "out" / "report.html").read_text()
    assert '"start": "in time since the vehicle was switched on"' in html
    assert "in simulated time" not in html
    assert flown["figures"]["height, maximum"]["value"] == pytest.approx(1.0 + bags.OFFSET, 1e-3)
    assert flown["figures"]["duration"]["value"] == pytest.approx(bags.LANDED - bags.TAKEOFF, 1e-2)
    assert flown["figures"]["battery, lowest"]["value"] == pytest.approx(3.9)


def bag(path, delay=0.0):
    """Write a bag of cf1's flight, with its attitude as motion capture measures it, and cf2's."""
    with bags.written(path) as file:
        for name, sign in (("cf1", 1.0), ("cf2", -0.5)):
            bags.write_flight(file, name)
            for number, time in bags.steps():
                roll, pitch = tilt(time)
                message = PoseStamped(header=bags.header(time, number))
                message.pose.position.z = bags.height(time)[0]
                q = message.pose.orientation
                q.x, q.y, q.z, q.w = quaternion_from_zyx(sign * roll, sign * pitch, -0.4)
                file.write(f"/{name}/pose", message, bags.stamp(time))
    return path


@pytest.mark.parametrize(("start", "until"), [(SWITCHED_ON, bags.END), (4000.0, 8.0)])
def test_a_log_is_laid_over_the_vehicle_whose_attitude_it_has(run, start, until):
    log = flight(run.folder / "log07", start=start, noise=0.01, until=until)
    status, output, flown = run(bag(run.folder / "a.bag"), log)
    assert status == 0
    assert [each["vehicle"] for each in flown] == ["cf1", "cf2", "cf1 log07"]
    found = [each["phases"] for each in flown]
    assert found[2] == found[0]
    (line,) = [each for each in output.splitlines() if "is laid over cf1" in each]
    offset, correlation = (float(line.partition(each)[2].split()[0]) for each in ("0 is at", "by"))
    assert offset == pytest.approx(-start, abs=0.5 * PERIOD)
    assert correlation > 0.9


def test_a_log_of_another_flight_is_shown_by_itself(run):
    def other(time):
        return 0.08 * math.sin(1.3 * time * time), 0.06 * math.cos(0.7 * time)

    log = flight(run.folder / "log07", angles=other)
    status, output, flown = run(bag(run.folder / "a.bag"), log)
    assert status == 0
    assert [each["vehicle"] for each in flown] == ["cf1", "cf2", "log07"]
    assert "log07 is shown by itself: its attitude correlates with that of cf" in output


def test_what_is_too_short_has_no_place():
    short = np.column_stack([np.arange(0.0, 2.0, 0.01), np.zeros((200, 2))])
    assert position(short, short) is None
    assert position(short[:0], short) is None


def test_a_damaged_time_is_left_out(run):
    log = flight(run.folder / "log07")
    data = bytearray(log.read_bytes())
    # The highest byte of the time of the last event, of 10 floats, before the check sum.
    data[-4 - 40 - 1] = 1
    log.write_bytes(data)
    status, output, flown = run(bag(run.folder / "a.bag"), log, "--mcap")
    assert status == 0
    assert "log07 is laid over cf1" in output
    assert "its check sum is another one" in output
    assert flown[2]["figures"]["duration"] == flown[0]["figures"]["duration"]
    rows = np.column_stack([np.arange(0.0, 20.0, 0.01), np.zeros((2000, 2))])
    assert position(rows, rows) is not None
    rows[-1, 0] = 4e9
    assert position(rows, rows) is None


def test_a_vehicle_may_have_been_on_for_days(tmp_path):
    values = (0.0,) * 10
    kinds = {(3, "fixedFrequency"): (*POSE, *ANGLES, *TARGET)}
    later = 3.0 * LONGEST
    times = [1e13, later + 0.1, later + 0.2, 2.0, later + 0.3, 9e9, later + 0.4, 1e13]
    found, _ = rows(written(tmp_path / "log07", kinds, [(3, time, values) for time in times]))
    assert [time - later for time, _ in found["state"]] == pytest.approx([0.1, 0.2, 0.3, 0.4])


def test_a_log_that_breaks_off_or_is_damaged_is_read_as_far_as_it_goes(tmp_path):
    path = flight(tmp_path / "log07")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    found, file = rows(path)
    assert 3600 < len(found["state"]) < 3800
    assert "breaks off at 0.19 of 0.19 MB" in file.interruption
    path.write_bytes(whole[:-1] + b"\0")
    found, file = rows(path)
    assert len(found["state"]) == 7500
    assert "its check sum is another one" in file.interruption


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"\xbc\x03\0\0\0", "has version 3 of the format; expected 1 or 2"),
        (b"\xbc\x02", "the header of this log is damaged"),
        (b"\xbc\x02\0\xff\xff\1\0name", "the header of this log is damaged"),
        (b"\xbc\x02\0\1\0\1\0e\0\1\0acc.x\0", r"variables acc.x; expected each as in acc.x\(f\)"),
        (b"\xbc\x02\0\1\0\1\0e\0\1\0acc.x(s)\0", "variables acc.x"),
        (b"\xbc\x02\0\1\0\1\0e\0\1\0acc.x(f)\0", "no variables of a flight; .* There are: acc.x"),
    ],
)
def test_what_is_no_log_is_named(tmp_path, data, text):
    path = tmp_path / "log"
    path.write_bytes(data)
    with pytest.raises(BagError, match=text):
        UsdLogFile(path)


def attitudes(path):
    """Write a log that has attitudes only."""
    times = np.arange(0.0, 12.0, 0.01)
    events = [(1, t, (*np.degrees((tilt(t)[0], -tilt(t)[1])), 0.0)) for t in times]
    return written(path, {(1, "a"): ANGLES}, events)


@pytest.mark.filterwarnings("error")
def test_a_log_of_attitudes_alone_has_no_flight(run):
    status, output, flown = run(attitudes(run.folder / "log07"))
    assert (status, flown) == (0, [])
    assert "It has no flight." in output


def test_a_log_of_attitudes_alone_is_laid_over_too(run):
    log = attitudes(run.folder / "log07")
    status, output, flown = run(bag(run.folder / "a.bag"), log)
    assert (status, [each["vehicle"] for each in flown]) == (0, ["cf1", "cf2", "cf1 log07"])
    assert "log07 is laid over cf1" in output
