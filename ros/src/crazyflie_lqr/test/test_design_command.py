"""The command design_gains, and the gain files that are its output."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from crazyflie_lqr import design_command
from crazyflie_lqr.design import Design
from crazyflie_lqr.design_command import main, report
from crazyflie_lqr.gain_file import load_matrix
from crazyflie_lqr.models import near_hover

CONFIG = Path(__file__).parents[1] / "config"
USUAL = {
    "--model": "near_hover",
    "--Q": "1 1 4 1 1 4 100",
    "--R": "0.01 0.01 0.01 0.01",
    # They bear too little delay to be flown.
    "--force": "",
}


def arguments(**changes):
    """Return a command line; an option that is None is omitted."""
    options = {**USUAL, **{f"--{name}": value for name, value in changes.items()}}
    return shlex.split(" ".join(f"{k} {v}" for k, v in options.items() if v is not None))


@pytest.fixture
def without_report(monkeypatch):
    """Leave out the report: it takes most of the time."""
    monkeypatch.setattr(design_command, "report", lambda model, design: "")


@pytest.mark.usefixtures("without_report")
@pytest.mark.parametrize("path", sorted(CONFIG.glob("K_*.txt")), ids=lambda path: path.name)
def test_shipped_gains_are_what_the_command_in_their_comment_makes(path, tmp_path):
    shipped = path.read_text().splitlines()
    [command] = [line for line in shipped if line.startswith("# design_gains ")]
    out = tmp_path / "K.txt"
    assert main([*shlex.split(command)[2:], "--out", str(out)]) == 0
    made = out.read_text().splitlines()
    comments = [line for line in shipped if line.startswith("#")]
    assert [line for line in made if line.startswith("#")] == comments
    x_dim = 12 if "--model full_state" in command else 7
    np.testing.assert_allclose(
        load_matrix(str(out), 4, x_dim), load_matrix(str(path), 4, x_dim), rtol=1e-8, atol=1e-12
    )


def test_there_are_gains_to_ship():
    names = {path.name for path in CONFIG.glob("K_*.txt")}
    assert names == {f"K_{use}.txt" for use in ("sim", "hover", "soft", "quadrotor", "full_state")}


def test_prints_gains_poles_and_margins(capsys):
    assert main(arguments(R="1 1 1 1", Q="1 1 1 1 1 1 4")) == 0
    output = capsys.readouterr().out
    assert "near_hover, continuous time" in output
    [poles] = re.findall(r"poles \(rad/s\): (.*)", output)
    assert "-2" in poles.split(", ")
    _, yaw, flown = (line for line in output.splitlines() if line.startswith("yaw_dot "))
    assert yaw.split() == ["yaw_dot", "inf", "-inf", "90", "2", "785"]
    # A control is held for 10 ms: half of that on average.
    assert flown.split() == ["yaw_dot", "780", "0.99"]
    assert len(output.splitlines()) < 25
    # Poles that are there twice, gains below the names of their states.
    assert "(x2)" in poles
    _, states, *gains = output.splitlines()[:6]
    assert {len(line) for line in [states, *gains]} == {78}
    assert gains[2].split() == ["yaw_dot", *"000000", "-2"]


def test_poles_are_listed_the_slowest_first():
    A = np.diag([-30.0, -30.0, -30.0, -2.0, -2.0, -1e-3, -1e-3])
    A[5, 6], A[6, 5] = 5e-4, -5e-4
    A[3, 4], A[4, 3] = 1.0, -1e-15  # Two that are the same but for rounding.
    text = report(near_hover(), Design(np.zeros((4, 7)), A, np.zeros((7, 4)), 0.0))
    assert "poles (rad/s): -0.001 +- 0.0005j, -2 (x2), -30 (x3)\n" in text


def test_a_gain_that_may_only_shrink_to_a_ninth_is_in_decibels():
    # s^3 + k (3 s^2 + 3 s + 1) is stable for k > 1/9.
    A, B, K = -np.eye(7), np.zeros((7, 4)), np.zeros((4, 7))
    A[:3, :3] = np.eye(3, k=1)
    B[2, 3], K[3, :3] = 1.0, (-1.0, -3.0, -3.0)
    thrust = report(near_hover(), Design(K, A, B, 0.0)).splitlines()[-1]
    assert thrust.split()[1:3] == ["inf", "-19.1"]


def test_margins_are_in_decibels(capsys):
    # z - 1 + k = 0 is stable up to k = 2; without a cost of the control k is 1.
    assert main(arguments(R="1 1 1e-6 1", sample_time=1.0)) == 0
    _, yaw, _ = (line for line in capsys.readouterr().out.splitlines() if line[:7] == "yaw_dot")
    assert yaw.split()[1:3] == ["6.02", "-inf"]


@pytest.mark.usefixtures("without_report")
def test_the_command_in_the_comment_makes_the_same_gains(tmp_path):
    Q = np.diag([1.0, 1, 4, 1, 1, 4, 100])
    Q[0, 1] = Q[1, 0] = 0.5
    N = np.zeros((7, 4))
    N[2, 3] = 0.01
    weights = {"Q": " ".join(map(str, Q.ravel())), "N": " ".join(map(str, N.ravel()))}
    first, second = tmp_path / "first.txt", tmp_path / "second.txt"
    assert main(arguments(**weights, sample_time=0.01, delay=0.025, out=first)) == 0
    [command] = [line for line in first.read_text().splitlines() if "# design_gains" in line]
    assert main([*shlex.split(command)[2:], "--out", str(second)]) == 0
    assert second.read_text() == first.read_text()


def test_sampled_design_says_so_and_keeps_it_in_the_comment(tmp_path, capsys):
    out = tmp_path / "K.txt"
    assert main(arguments(sample_time=0.01, delay=0.025, out=out, force=None)) == 0
    assert "sampled every 10 ms, 3 controls on their way" in capsys.readouterr().out
    assert "--sample_time 0.01 --delay 0.025\n" in out.read_text()
    K = load_matrix(str(out), 4, 7)
    assert -10.0 < K[1, 0] < -1.0


@pytest.mark.usefixtures("without_report")
@pytest.mark.parametrize(
    "form", ["1 1 4 1 1 4 100", "1,1,4,1,1,4,100", "'1 1 4 1 1 4 100'", "{diagonal}", "{matrix}"]
)
def test_weights_may_be_numbers_or_a_file(form, tmp_path):
    diagonal = [1, 1, 4, 1, 1, 4, 100]
    files = {"diagonal": tmp_path / "diagonal.txt", "matrix": tmp_path / "matrix.txt"}
    np.savetxt(files["diagonal"], diagonal, header="diagonal of Q")
    np.savetxt(files["matrix"], np.diag(diagonal), header="Q")
    out = tmp_path / "K.txt"
    assert main(arguments(Q=form.format(**files), out=out)) == 0
    assert out.read_text() == (CONFIG / "K_hover.txt").read_text()


@pytest.mark.usefixtures("without_report")
def test_a_matrix_may_be_longer_than_a_name_of_a_file(tmp_path):
    out = tmp_path / "K.txt"
    words = ",".join(f"{value:.6f}" for value in np.diag([1, 1, 4, 1, 1, 4, 100]).ravel())
    assert main(arguments(Q=words, out=out)) == 0
    assert (
        load_matrix(str(out), 4, 7).tolist() == load_matrix(CONFIG / "K_hover.txt", 4, 7).tolist()
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"Q": "1 1 4"}, "Q has 3 numbers; expected 7 (the diagonal) or 49 (7 rows of 7)"),
        ({"R": "1 1 1 1 1"}, "R has 5 numbers; expected 4 (the diagonal) or 16"),
        ({"N": "1 1 1 1 1 1 1"}, "N has 7 numbers; expected 28 (7 rows of 4)"),
        ({"Q": "-1 1 4 1 1 4 100"}, "Q is not positive semidefinite"),
        ({"Q": "-1,1,4,1,1,4,100"}, "Q is not positive semidefinite"),
        ({"R": "0 1 1 1"}, "R is not positive definite"),
        ({"R": "1 1 0 0  0 1 0 0  0 0 1 0  0 0 0 1"}, "R is not symmetric"),
        ({"R": "1 1 one 1"}, "'one'"),
        ({"R": "1 1_0 1 1"}, "'1_0' is not a number"),
        ({"Q": "nan 1 4 1 1 4 100"}, "Q has entries that are not finite"),
        ({"Q": "Q.txt"}, "and not the name of a file"),
        ({"Q": "1 0 4 1 1 4 0"}, "do not see"),
        ({"delay": "0.1"}, "a delay needs a sample time"),
        ({"sample_time": "-0.1"}, "sample time"),
    ],
)
def test_bad_input_is_refused_and_nothing_is_written(changes, message, tmp_path, capsys):
    out = tmp_path / "K.txt"
    assert main(arguments(out=out, **changes)) == 1
    error = capsys.readouterr().err
    assert error.startswith("design_gains: ")
    assert message in error
    assert not out.exists()


@pytest.mark.parametrize("changes", [{"model": "fixed_wing"}, {"Q": None}, {"sample_time": "fast"}])
def test_wrong_usage_is_refused(changes, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(arguments(**changes))
    assert "usage:" in capsys.readouterr().err


def test_a_file_that_cannot_be_written_is_named(tmp_path, capsys):
    assert main(arguments(out=tmp_path / "missing" / "K.txt")) == 1
    assert "missing/K.txt" in capsys.readouterr().err


def test_gains_that_bear_too_little_delay_are_refused_unless_forced(tmp_path, capsys):
    out = tmp_path / "K.txt"
    assert main(arguments(out=out, force=None)) == 1
    assert "tolerate 6.9 ms of delay; expected at least 20 ms" in capsys.readouterr().err
    assert not out.exists()
    assert main(arguments(out=out)) == 0
    assert "--force\n" in out.read_text()


def test_a_plant_without_a_state_of_the_model_is_refused(capsys):
    assert main(["--model", "full_state", "--plant", "near_hover", "--Q", *["1"] * 12,
                 "--R", *["1"] * 4]) == 1  # fmt: skip
    assert "near_hover has no roll, pitch" in capsys.readouterr().err


@pytest.mark.parametrize("times", [{}, {"sample_time": 0.01, "delay": 0.02}])
def test_plot_is_a_picture(times, tmp_path):
    plot = tmp_path / "design.png"
    assert main(arguments(plot=plot, **times)) == 0
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_a_picture_in_the_home_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert main(arguments(plot="~/design.png")) == 0
    assert (tmp_path / "design.png").exists()


def test_a_plot_of_no_format_is_refused(tmp_path, capsys):
    assert main(arguments(plot=tmp_path / "design.sheet")) == 1
    assert "sheet" in capsys.readouterr().err
