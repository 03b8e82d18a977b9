"""Changes of live parameters at random, for hypothesis."""

import math

from hypothesis import strategies as st

from crazyflie_utils.parameters.declaration import Parameters
from crazyflie_utils.parameters.types import Number


def legal_numbers(number: Number) -> st.SearchStrategy[float]:
    """Return a strategy for the values of a parameter: those at the ends of its range often."""
    low = max(number.minimum, number.above)
    low, high = max(low, -1.7e308), min(number.maximum, 1.7e308)
    is_excluded = low == number.above
    ends = [math.nextafter(low, math.inf) if is_excluded else low, high, 0.0, 5e-324, -5e-324]
    edges = [end for end in ends if low <= end <= high and not (is_excluded and end == low)]
    return st.sampled_from(edges) | st.floats(low, high, exclude_min=is_excluded)


def live_changes(parameters_type: type[Parameters]) -> st.SearchStrategy[dict[str, float]]:
    """Return a strategy for legal values of some of the live numbers, by their names."""
    values = {
        declaration.name: legal_numbers(declaration.type)
        for declaration in parameters_type.declarations()
        if declaration.live and isinstance(declaration.type, Number)
    }
    return st.fixed_dictionaries({}, optional=values)
