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
        (["none.py"], "none.py: No such file"),
        (["README.md"], "README.md: expected a mission script, FILE.py"),
        (["broken.py"], "broken.py is not a Python script: invalid syntax"),
        (["data.py"], "data.py is not a Python script: "),
        ([__file__, "0"], "n is 0; expected one number of vehicles"),
        ([__file__, "2", "3"], "n is 2 3; expected one number"),
        ([__file__, "two"], "n is two; expected one number"),
        ([__file__, "2", "--out", "out", "spacings:=1"], "did you mean spacing?"),
    ],
)
def test_bad_input_is_named_before_anything_is_launched(
    arguments, complaint, monkeypatch, capsys, tmp_path
):
    (tmp_path / "README.md").write_text("# A page\n")
    (tmp_path / "broken.py").write_text("def f(:\n")
    (tmp_path / "data.py").write_bytes(b"\xff\xfe\x00")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["mission", *arguments])
    with pytest.raises(SystemExit) as end:
        mission.main()
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err
