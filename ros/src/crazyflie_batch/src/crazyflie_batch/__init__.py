"""Flights of many vehicles at once, without ROS; see `simulate`."""

from crazyflie_batch.batch import Flights
from crazyflie_batch.estimators import FiniteDifferences, Kalman
from crazyflie_batch.simulation import (
    Controller,
    Measurement,
    Model,
    coupled_7d,
    near_hover,
    quadrotor,
    simulate,
)

__all__ = [
    "Controller",
    "FiniteDifferences",
    "Flights",
    "Kalman",
    "Measurement",
    "Model",
    "coupled_7d",
    "near_hover",
    "quadrotor",
    "simulate",
]
