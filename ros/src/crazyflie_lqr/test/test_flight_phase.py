"""The guess whether a vehicle stands on the ground."""

from crazyflie_lqr.linear_feedback import GroundGuess


def test_who_hangs_in_the_air_flies():
    guess = GroundGuess()
    assert guess.is_flying(0.2, 1.0, 0.0)
    guess.is_flying(0.2, 1.0, 10.0)
    assert guess.is_flying(0.3, 1.0, 10.1)


def test_who_does_not_lift_off_stands():
    guess = GroundGuess()
    assert guess.is_flying(0.2, 1.0, 10.0)
    assert guess.is_flying(0.2, 1.0, 12.9)
    assert not guess.is_flying(0.2, 1.0, 13.1)
    # The same goal over and over is not a new one.
    assert not guess.is_flying(0.21, 1.01, 20.0)
    assert guess.is_flying(0.2, 0.8, 30.0)
    assert not guess.is_flying(0.2, 0.8, 34.0)


def test_after_a_reset_of_the_clock_it_does_not_take_for_ever():
    guess = GroundGuess()
    assert guess.is_flying(0.0, 1.0, 1000.0)
    assert guess.is_flying(0.0, 1.0, 1.0)
    assert not guess.is_flying(0.0, 1.0, 4.1)


def test_what_has_lifted_off_is_5_cm_above_the_lowest_height():
    guess = GroundGuess()
    guess.is_flying(0.25, 1.0, 0.0)
    guess.is_flying(0.125, 1.0, 1.0)
    assert not guess.is_flying(0.17, 1.0, 3.0)
    assert guess.is_flying(0.18, 1.0, 3.0)
    # 4 cm are not a new height of the reference, 6 cm are.
    assert not guess.is_flying(0.125, 1.04, 10.0)
    assert guess.is_flying(0.125, 1.06, 10.0)
