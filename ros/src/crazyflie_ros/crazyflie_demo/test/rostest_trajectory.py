"""A virtual vehicle flies the figure eight."""

import signal
from pathlib import Path

import numpy as np
from flights import Observer, launched, virtual_vehicle

from crazyflie_demo.trajectory_file import load

FIGURE8 = Path(__file__).parents[1] / "data" / "figure8.csv"


def test_a_figure_eight():
    with (
        Observer() as observer,
        virtual_vehicle(**{"observer/port": observer.port}) as uri,
        launched("crazyflie_demo", "execute_trajectory.launch", uri=uri),
    ):
        start = observer.track_until(lambda truth: truth.position[2] > 0.4)[-1].position
        track = observer.track_until(lambda truth: truth.position[2] < 0.02)
    flown = np.array([truth.position[:2] for truth in track]) - start[:2]
    times = np.linspace(0.0, 1.0, 100)
    curve = np.hstack([piece.evaluate(times).position[:2] for piece in load(FIGURE8)]).T
    # Every point of the path is near the curve, and every point of the curve near the path.
    distances = np.linalg.norm(flown[::5, None, :] - curve[None, ::5, :], axis=2)
    assert distances.min(axis=1).max() < 0.12
    assert distances.min(axis=0).max() < 0.12


def test_ctrl_c_in_flight_is_a_landing():
    """With roslaunch all nodes end at once, the driver among them."""
    with (
        Observer() as observer,
        virtual_vehicle(**{"observer/port": observer.port}) as uri,
        launched("crazyflie_demo", "execute_trajectory.launch", uri=uri) as flight,
    ):
        observer.track_until(lambda truth: truth.position[2] > 0.45)
        flight.send_signal(signal.SIGINT)
        track = observer.track_until(lambda truth: truth.position[2] < 0.02)
    highest = max(track, key=lambda truth: truth.position[2])
    # A fall from there would take a third of a second.
    assert track[-1].time - highest.time > 1.0
    assert -track[-1].velocity[2] < 0.8
