"""Formulas in floats and in arrays."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from crazyflie_model.elementwise import clip, functions, join, nowhere, split, where

NUMBERS = st.floats(-1e6, 1e6)


@given(arrays(float, array_shapes(min_dims=1, max_dims=3), elements=NUMBERS))
def test_join_undoes_split(vectors):
    np.testing.assert_array_equal(join(split(vectors)), vectors)
    assert len(split(vectors)) == vectors.shape[-1]


def test_one_vehicle_is_floats_and_many_are_arrays():
    assert all(type(part) is float for part in split(np.ones(3)))
    assert [part.shape for part in split(np.ones((5, 3)))] == [(5,)] * 3


def test_join_broadcasts():
    assert join([1.0, np.zeros(4)]).shape == (4, 2)


@given(arrays(float, 6, elements=NUMBERS), NUMBERS, NUMBERS)
def test_floats_and_arrays_agree(values, a, b):
    low, high = min(a, b), max(a, b)
    np.testing.assert_array_equal(
        clip(values, low, high), [clip(v, low, high) for v in split(values)]
    )
    np.testing.assert_array_equal(
        where(values < a, values, b), [where(v < a, v, b) for v in split(values)]
    )
    assert all(low <= v <= high for v in clip(values, low, high))


def test_nowhere():
    conditions = [False, np.zeros(2, dtype=bool), True, np.array([False, True]), "unknown yet"]
    assert [nowhere(each) for each in conditions] == [True, True, False, False, False]


@pytest.mark.parametrize("name", ["sin", "cos", "tan", "sqrt", "hypot", "atan2", "asin"])
def test_both_modules_have_the_functions(name):
    arguments = [0.3, 0.4] if name in ("hypot", "atan2") else [0.3]
    in_arrays = getattr(functions(np.array(0.3)), name)(*map(np.array, arguments))
    assert getattr(functions(0.3), name)(*arguments) == pytest.approx(float(in_arrays), rel=1e-15)
    assert functions(0.3) is math


def test_a_limited_float_stays_one():
    assert [clip(each, 0.0, 1.0) for each in (-2.0, 0.5, 2.0)] == [0.0, 0.5, 1.0]
    assert type(clip(0.5, 0.0, 1.0)) is float
