"""A mission script's vehicles, and what is printed of its commands."""

import pytest

import crazyflie_mission_api
from crazyflie_dev import mission
from crazyflie_dev.mission_script import AnnouncingFleet


@pytest.mark.parametrize(
    ("script", "n"), [('Fleet(["cf1", "cf12"])', 12), ("Fleet(names)", 5), ("cf0 scf7 cf3x", 5)]
)
def test_vehicles_are_those_that_the_script_names(script, n):
    assert mission.vehicles_of(script) == n


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["none.py"], "there is no file none.py"),
        ([__file__, "0"], "n is 0; expected one number of vehicles"),
        ([__file__, "2", "3"], "n is 2 3; expected one number"),
        ([__file__, "two"], "n is two; expected one number"),
    ],
)
def test_bad_input_is_named(arguments, complaint, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["mission", *arguments])
    with pytest.raises(SystemExit) as end:
        mission.main()
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err


def test_commands_are_printed_once(monkeypatch, capsys):
    fleet = object.__new__(AnnouncingFleet)
    fleet._vehicles = dict.fromkeys(["cf1", "cf2"])
    clock = iter((100.0, 102.5))
    monkeypatch.setattr(AnnouncingFleet, "time", lambda _: next(clock))
    monkeypatch.setattr(AnnouncingFleet, "_first", None)
    for command in ("takeoff", "formation"):
        # A command that is made of another one: only the first is printed.
        with pytest.raises(crazyflie_mission_api.MissionError):
            getattr(fleet, command)("nonsense")
    assert capsys.readouterr().out.splitlines() == [
        "    0.0 s  takeoff: cf1, cf2",
        "    2.5 s  formation: cf1, cf2",
    ]
