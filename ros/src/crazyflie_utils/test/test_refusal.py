"""Refusals in words."""

import pytest

from crazyflie_utils.refusal import by_reason, distinct, listed


def test_reasons_that_differ_in_numbers_are_one():
    reasons = {"cf1": "battery at 3.05 V", "cf2": "battery at 2.9 V", "cf3": "no pose"}
    assert by_reason(reasons) == [
        "cf1, cf2: battery at 3.05 V (numbers of cf1)",
        "cf3: no pose",
    ]
    assert by_reason(dict.fromkeys(("cf1", "cf2"), "at 3 V")) == ["cf1, cf2: at 3 V"]


@pytest.mark.parametrize(
    ("value", "limit", "texts"),
    [
        (0.2, 0.33, ("0.20", "0.33")),
        (0.3284, 0.33, ("0.328", "0.330")),
        (0.33, 0.33, ("0.33", "0.33")),
        (0.33 - 1e-12, 0.33, ("0.330000000", "0.330000000")),
    ],
)
def test_numbers_that_differ_are_told_apart(value, limit, texts):
    assert distinct(value, limit) == texts
    assert distinct(0.278, 0.33, "g", 3) == ("0.278", "0.33")
    assert distinct(0.32996, 0.33, "g", 3) == ("0.32996", "0.33")


def test_of_many_names_only_their_number_is_said():
    assert listed(["cf1", "cf2"]) == "cf1, cf2"
    names = [f"cf{k}" for k in range(100)]
    assert (listed(names), listed(names, "nodes")) == ("100 vehicles", "100 nodes")
