"""The vehicles of a mission script, and what its command line refuses."""

import pytest

from crazyflie_dev import mission


@pytest.mark.parametrize(
    ("script", "n"), [('Fleet(["cf1", "cf12"])', 12), ("Fleet(names)", 5), ("cf0 scf7 cf3x", 5)]
)
def test_vehicles_are_those_that_the_script_names(script, n):
    assert mission.vehicles_of(script) == n


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["none.py"], "the file none.py does not exist"),
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
