"""State feedback controllers of the Crazyflie, and the design of their gains."""
