"""How fast many vehicles are computed at once, without ROS."""

from crazyflie_dev.bench.row import Row


def _steps(n):
    # Here, since what makes machine code takes long to load.
    from crazyflie_batch import bench

    return bench.steps_per_second(n)[0]


ROWS = [
    Row(
        "batch_many",
        "batch simulation, n = 10 000: steps of 13 states",
        "1/s",
        lambda: _steps(10_000),
        least=10e6,
    ),
    Row(
        "batch_one",
        "batch simulation, n = 1: steps of 13 states",
        "1/s",
        lambda: _steps(1),
        least=500e3,
    ),
]
