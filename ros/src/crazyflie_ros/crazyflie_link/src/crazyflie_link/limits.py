"""Limits of commands and log blocks; without cflib, for those who only check parameters."""

#: A shorter duration (s), or a smaller time scale, is a mistake: the planner, at 100 Hz, would ask
#: for the end of the motion at once.
MIN_DURATION = 0.01

#: Unit of periods in the firmware (ms): one byte, in which 255 is not allowed.
SHORTEST_PERIOD_MS, LONGEST_PERIOD_MS, PERIOD_STEP_MS = 10, 2540, 10

#: Number of times that a command is broadcast, and the period (s): a vehicle that receives only the
#: last one begins 4 ms after the others.
REPEATS, REPEAT_PERIOD = 5, 0.001
