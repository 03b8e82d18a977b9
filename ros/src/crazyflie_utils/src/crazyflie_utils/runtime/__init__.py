"""What the node handle stands on: one process, its executor, clocks, topics, services and tf."""
