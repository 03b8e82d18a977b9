"""Steps that wait for futures, one after the other."""

from concurrent.futures import Future

import pytest

from crazyflie_utils.steps import follow


def test_steps_go_on_until_one_fails():
    begun = []

    def calls():
        for number in range(5000):
            begun.append(Future())
            if number != 4000:
                begun[-1].set_result(number)
            assert (yield begun[-1]) == number

    outcome = follow(calls())
    assert len(begun) == 4001
    begun[-1].set_exception(ValueError("refused"))
    with pytest.raises(ValueError, match="refused"):
        outcome.result(timeout=0.0)
    assert len(begun) == 4001


def test_steps_may_handle_the_error_of_a_future_and_have_a_result():
    refused = Future()

    def calls():
        try:
            yield refused
        except ValueError as error:
            return str(error)

    outcome = follow(calls())
    assert not outcome.done()
    refused.set_exception(ValueError("refused"))
    assert outcome.result(timeout=0.0) == "refused"


def test_steps_but_the_first_are_submitted():
    submitted, first, second = [], Future(), Future()
    second.set_result(2)

    def calls():
        return ((yield first), (yield second))

    outcome = follow(calls(), lambda *work: submitted.append(work))
    assert submitted == []
    first.set_result(1)
    for count in (1, 2):
        assert len(submitted) == count and not outcome.done()
        work, argument = submitted[-1]
        work(argument)
    assert outcome.result(timeout=0.0) == (1, 2)
