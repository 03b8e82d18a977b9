"""Flying by velocity: cmd_vel to references, a joystick to cmd_vel, a circle from cmd_vel."""
