"""For test_run.py: a rostest that fails."""


def test_fails():
    assert 2 + 2 == 5
