"""Parameters of three types, from a file."""

import rospy


def describe() -> str:
    """Return the private parameters my_integer, my_float and my_string as one line.

    For example "my_integer 4, my_float 0.5, my_string Crazyflie"; my_float is 1.0 if nobody
    has set it.
    """
    integer = rospy.get_param("~my_integer")
    number = rospy.get_param("~my_float", 1.0)
    text = rospy.get_param("~my_string")
    return f"my_integer {integer}, my_float {number}, my_string {text}"


def main() -> None:
    """Log the parameters once."""
    rospy.init_node("settings")
    rospy.loginfo(describe())
