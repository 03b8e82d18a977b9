"""How fast many vehicles are computed at once, without ROS."""

from crazyflie_dev.bench.row import Row


def _steps_of_many():
    # Here, since what makes machine code takes long to load.
    from crazyflie_batch import bench

    return bench.steps_of_many()


def _steps_of_one():
    from crazyflie_batch import bench

    return bench.steps_of_one()


ROWS = [
    Row(
        "batch_many",
        "batch simulation, n = 10 000: steps of 13 states",
        "1/s",
        _steps_of_many,
        least=10e6,
    ),
    Row(
        "batch_one",
        "batch simulation, n = 1: steps of 13 states",
        "1/s",
        _steps_of_one,
        least=500e3,
    ),
]
