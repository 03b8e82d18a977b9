"""Parameters of the state estimators."""

from crazyflie_model.limits import CRASH_TILT, MAX_SPEED
from crazyflie_state_estimator import kalman
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import BOOLEAN, FRAME, TIME_STEP, TOPIC, Integer, Number, Text

FINITE_DIFFERENCE, KALMAN = "finite_difference", "kalman"


class StateEstimatorParameters(Parameters):
    """Parameters of an estimator of 7 states; subclasses declare another `x_dim`."""

    x_dim: int = parameter(Integer(7, 7), "number of fields of the state")
    time_step: float = parameter(TIME_STEP, "period at which tf is read")
    fixed_frame: str = parameter(FRAME, "frame the state is in", name="frames/fixed")
    robot_frame: str = parameter(FRAME, "frame of the vehicle", name="frames/robot")
    state_topic: str = parameter(TOPIC, "where states go", name="topics/state")
    acts_on_arrival: bool = parameter(
        BOOLEAN,
        "answer a new pose as soon as it comes, at most one every `time_step`, and do not wait for "
        "the next time step",
        False,
        "act_on_arrival",
    )
    filter_type: str = parameter(
        Text((FINITE_DIFFERENCE, KALMAN)), "how rates are found", FINITE_DIFFERENCE, "filter/type"
    )
    control_topic: str | None = parameter(
        TOPIC,
        "the vehicle's control, such as /control/final: poses must follow it, and the Kalman "
        "filter uses it",
        None,
        "topics/control",
    )
    max_speed: float = parameter(
        Number("m/s", above=0.0),
        "poses that a vehicle can reach only faster than this are rejected",
        MAX_SPEED,
        "pose/max_speed",
    )
    max_tilt: float = parameter(
        Number("rad", above=0.0),
        "a vehicle that is tilted more than this has crashed",
        CRASH_TILT,
        "pose/max_tilt",
    )


# Their squares, and quotients of these, are far from the ends of the range of floats.
_ACCELERATION_WALK = Number("m/s^2/sqrt(s)", minimum=1e-6, maximum=1e6)
_ACCELERATION_WALK_HELP = (
    "by how much the unknown part of the acceleration changes in a second (standard deviation)"
)


class KalmanParameters(Parameters):
    """Parameters of the Kalman filter where the control is not known."""

    position_noise: float = parameter(
        Number("m", minimum=1e-6, maximum=100.0),
        "standard deviation of the poses' coordinates",
        kalman.POSITION_NOISE,
        "filter/position_noise",
        live=True,
    )
    acceleration_walk: float = parameter(
        _ACCELERATION_WALK,
        _ACCELERATION_WALK_HELP,
        kalman.ACCELERATION_WALK,
        "filter/acceleration_walk",
        live=True,
    )
    angle_noise: float = parameter(
        Number("rad", minimum=1e-6, maximum=10.0),
        "standard deviation of the poses' angles",
        kalman.ANGLE_NOISE,
        "filter/angle_noise",
        live=True,
    )
    angular_acceleration_walk: float = parameter(
        Number("rad/s^2/sqrt(s)", minimum=1e-6, maximum=1e6),
        "as `filter/acceleration_walk`, of roll, pitch and yaw",
        kalman.ANGULAR_ACCELERATION_WALK,
        "filter/angular_acceleration_walk",
        live=True,
    )


class KalmanWithControlParameters(KalmanParameters):
    """Parameters of the Kalman filter where the control is known."""

    acceleration_walk: float = parameter(
        _ACCELERATION_WALK,
        _ACCELERATION_WALK_HELP,
        kalman.ACCELERATION_WALK_WITH_CONTROL,
        "filter/acceleration_walk",
        live=True,
    )
