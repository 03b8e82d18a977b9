"""A NatNet server that shows the virtual vehicles."""
