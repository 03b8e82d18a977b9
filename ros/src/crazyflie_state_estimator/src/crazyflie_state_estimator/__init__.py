"""From poses on /tf to states: positions, velocities, attitudes and their rates."""
