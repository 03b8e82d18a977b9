"""What the firmware of a Crazyflie does, in its own units and signs; no sockets, no wall clock."""
