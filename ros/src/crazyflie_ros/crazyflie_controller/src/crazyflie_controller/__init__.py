"""Flight to a goal by PID control."""
