"""Colors of Color LED decks."""

from crazyflie_model.lights import wrgb


def test_a_color_is_a_byte_each_and_the_white_light_is_off():
    assert wrgb(1.0, 0.5, 0.0) == 0x00FF8000
    assert wrgb(1.0, 1.0, 1.0) == 0x00FFFFFF
