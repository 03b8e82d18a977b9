"""The messages are those that existing bags and nodes speak."""

import re
from pathlib import Path

import pytest

from crazyflie_msgs import msg

MD5 = {
    "Control": "e914b14edeed586f23e350ad344ba302",
    "ControlStamped": "e85f24c467a6496a2e0c3b92ff0fe75d",
    "Disturbance": "c9aa644cdeaad9584fb826b2ed94d4e6",
    "DisturbanceStamped": "80be8921e09bd4e48576b3f7ed47cf46",
    "FullState": "1478f01b4f726b5b1e488813cdcd71d7",
    "FullStateStamped": "95ca4cda6afad75c125ca4a75fb052d8",
    "NoYawControl": "47183c443d602278cf66b107317355b1",
    "NoYawControlStamped": "466772a94931602dc602bc0ab3b45e59",
    "PositionVelocityState": "c9b55cbacbaa7251ae99292a70935fa6",
    "PositionVelocityStateStamped": "d7e2e75df27e542774773e0a516e76ff",
    "PositionVelocityYawState": "c9aa644cdeaad9584fb826b2ed94d4e6",
    "PositionVelocityYawStateStamped": "a6aa560aefcabb217b0840bff40f6ede",
    "PrioritizedControl": "6383d540d010819be07756f19814ef1f",
    "PrioritizedControlStamped": "283a1ef833d93b1cfda5ddc7601205cd",
}

STATUS = ("EstimateStatus", "FilterStatus", "FlightStatus", "VehicleStatus")
"""Of this workspace alone."""

POSITION_VELOCITY = ["x", "y", "z", "x_dot", "y_dot", "z_dot"]
FIELDS = {
    "Control": ["roll", "pitch", "yaw_dot", "thrust"],
    "Disturbance": [*POSITION_VELOCITY, "yaw"],
    "FullState": [*POSITION_VELOCITY, "roll", "pitch", "yaw", "roll_dot", "pitch_dot", "yaw_dot"],
    "NoYawControl": ["roll", "pitch", "thrust", "priority"],
    "PositionVelocityState": POSITION_VELOCITY,
    "PositionVelocityYawState": [*POSITION_VELOCITY, "yaw"],
    "PrioritizedControl": ["control", "priority"],
}


@pytest.mark.parametrize(("name", "md5"), MD5.items())
def test_md5(name, md5):
    assert getattr(msg, name)._md5sum == md5


def test_these_are_all():
    definitions = Path(__file__).resolve().parents[1] / "msg"
    assert sorted(path.stem for path in definitions.glob("*.msg")) == sorted([*MD5, *STATUS])


@pytest.mark.parametrize(("name", "fields"), FIELDS.items())
def test_fields_are_in_order(name, fields):
    assert getattr(msg, name).__slots__ == fields


@pytest.mark.parametrize("name", FIELDS)
def test_stamped_messages_hold_a_header_and_the_plain_message(name):
    stamped = getattr(msg, f"{name}Stamped")
    contents = ("control", "disturbance", "state")
    (content,) = (each for each in contents if name.lower().endswith(each))
    assert stamped.__slots__ == ["header", content]
    assert stamped._slot_types == ["std_msgs/Header", f"crazyflie_msgs/{name}"]


UNITS = {
    **dict.fromkeys(["x", "y", "z"], "m"),
    **dict.fromkeys(["x_dot", "y_dot", "z_dot"], "m/s"),
    **dict.fromkeys(["roll", "pitch", "yaw"], "rad"),
    **dict.fromkeys(["roll_dot", "pitch_dot", "yaw_dot"], "rad/s"),
    "thrust": "m/s^2",
    "priority": "0",
}
#: Units of the derivatives.
RATES = {
    **dict.fromkeys(["x", "y", "z"], "m/s"),
    **dict.fromkeys(["x_dot", "y_dot", "z_dot"], "m/s^2"),
    "yaw": "rad/s",
}


@pytest.mark.parametrize("name", MD5)
def test_the_comment_of_every_field_has_its_unit(name):
    definition = Path(__file__).resolve().parents[1] / "msg" / f"{name}.msg"
    for line in definition.read_text().splitlines():
        if line.startswith("float64"):
            field, _, comment = line.removeprefix("float64").partition("#")
            units = RATES if "Disturbance" in name else UNITS
            assert units[field.strip()] in re.split("[ ,;]+", comment), line


@pytest.mark.parametrize("name", STATUS)
def test_a_status_has_a_stamp_and_words(name):
    status = getattr(msg, name)
    assert status.__slots__[0] == "header"
    assert {"reason", "text"} & set(status.__slots__)


def test_the_flight_state_that_a_filter_reports_is_unknown_at_first():
    assert msg.FilterStatus().flight_state == msg.FlightStatus.UNKNOWN
