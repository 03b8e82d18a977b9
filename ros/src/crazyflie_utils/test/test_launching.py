"""Errors of a launch are reported."""

from crazyflie_utils.testing.launching import complaints


def test_complaints_are_found_among_other_output(tmp_path):
    log = tmp_path / "launch.log"
    log.write_text(
        "started roslaunch server\n"
        "\x1b[31m[ERROR] [1.0]: /lqr_controller: parameter /lqr_controller/K_file is 'x'\x1b[0m\n"
        "[INFO] [2.0]: all is well\n"
        "\x1b[31m[lqr_controller-5] process has died [pid 1, exit code 1]\x1b[0m\n"
    )
    assert complaints(log) == [
        "[ERROR] [1.0]: /lqr_controller: parameter /lqr_controller/K_file is 'x'",
        "[lqr_controller-5] process has died [pid 1, exit code 1]",
    ]
