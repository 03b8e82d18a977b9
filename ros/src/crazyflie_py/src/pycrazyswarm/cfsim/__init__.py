"""The package of Crazyswarm 1's bindings of the firmware, which scripts import."""
