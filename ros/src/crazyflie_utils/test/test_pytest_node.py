"""What rostest says, as pytest understands it."""

from crazyflie_utils.testing.pytest_node import pytest_arguments


def test_results_go_where_rostest_looks_for_them():
    arguments = pytest_arguments(["a.py", "b.py", "--gtest_output=xml:/tmp/r.xml"])
    assert arguments[:3] == ["a.py", "b.py", "--junit-xml=/tmp/r.xml"]


def test_text_mode_has_no_results():
    assert pytest_arguments(["a.py", "--text"])[:2] == ["a.py", "-p"]
