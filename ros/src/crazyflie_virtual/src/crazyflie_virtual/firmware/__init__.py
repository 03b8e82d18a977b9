"""The firmware of a Crazyflie, in its own units and signs, without sockets and wall clock."""
