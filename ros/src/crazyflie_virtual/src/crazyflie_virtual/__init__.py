"""A Crazyflie in software that speaks CRTP over UDP, and a motion capture system that sees it."""
