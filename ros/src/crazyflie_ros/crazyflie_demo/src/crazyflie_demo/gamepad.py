"""Numbers of a gamepad's axes and buttons, as all demos use them."""

#: Axes, with the right stick for tilt: left, up and forward are positive.
ROLL, PITCH, YAW, THRUST = 3, 4, 0, 1
LAND, EMERGENCY, TAKEOFF, HEADLIGHT = 0, 1, 2, 4  #: Buttons.
AXES, BUTTONS = 8, 11  #: How many a gamepad has.
