"""Color LED decks, below and on top of a Crazyflie, by their firmware parameters."""

#: Parameter that is 1 if the vehicle carries the deck -> parameter with the deck's color.
COLOR_LED_DECKS = {
    "deck.bcColorLedBot": "colorLedBot.wrgb8888",
    "deck.bcColorLedTop": "colorLedTop.wrgb8888",
}


def wrgb(red: float, green: float, blue: float) -> int:
    """Return the value of a color, 0 to 1 each: a byte each of white, red, green and blue."""
    red, green, blue = (round(255.0 * part) for part in (red, green, blue))
    return red << 16 | green << 8 | blue
