"""Flight states in words."""

from crazyflie_msgs.msg import FlightStatus

WORDS = {
    FlightStatus.UNKNOWN: "not known to fly",
    FlightStatus.ON_GROUND: "on the ground",
    FlightStatus.TAKING_OFF: "taking off",
    FlightStatus.FLYING: "flying",
    FlightStatus.DESCENDING: "descending",
    FlightStatus.LANDING: "landing",
}
"""Constant of `FlightStatus` to words."""
