"""Errors of formulas that cannot be traced, with the place of the formula."""

import traceback
from collections.abc import Iterator
from contextlib import contextmanager

#: Modules in which a formula ends that does what it must not.
_CALCULATES = ("crazyflie_batch.symbols", "crazyflie_model.elementwise", "numpy")


@contextmanager
def naming_the_formula() -> Iterator[None]:
    """Put the name, file and line of the formula before what is wrong with it: a TypeError."""
    try:
        yield
    except (AttributeError, TypeError, ValueError) as error:
        frames = [
            (frame.f_code, line)
            for frame, line in traceback.walk_tb(error.__traceback__)
            if not frame.f_globals["__name__"].startswith(_CALCULATES)
        ]
        code, line = frames[-1]
        raise TypeError(
            f"the formula {code.co_qualname} ({code.co_filename}, line {line}) cannot be "
            f"computed for many vehicles: {error}"
        ) from error
