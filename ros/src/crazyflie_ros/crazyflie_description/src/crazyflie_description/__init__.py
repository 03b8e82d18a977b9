"""How a Crazyflie and its flight are drawn."""
