"""Print what a 1 ms step of each model costs, and a node's tick around it.

Usage: python3 bench/step_cost.py, in a sourced workspace.
"""

import time

import numpy as np

from crazyflie_model.dynamics import Coupled7D, NearHover
from crazyflie_model.elementwise import split
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_model.units import GRAVITY
from crazyflie_simulator.quadrotor_simulator_node import QuadrotorSimulatorNode
from crazyflie_simulator.simulator_node import (
    NearHoverSimulatorCoupled7DNode,
    NearHoverSimulatorNode,
)
from crazyflie_simulator.vehicle import SimulatedVehicle
from crazyflie_simulator.wind import Wind
from crazyflie_utils.testing import FakeProcess

CONTROL = [0.01, 0.02, 0.1, GRAVITY]
VEHICLES = 100
REPEATS = 5


def best(function, count: int) -> float:
    """Return the least time of a few calls of ``function()``, over ``count``, in us."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times) / count * 1e6


def one_vehicle(dynamics) -> float:
    """Return us per step of one vehicle with a control every 10 ms."""
    vehicle = SimulatedVehicle(dynamics, (0.0, 0.0, 1.0), 0.0)

    def fly():
        for _ in range(200):
            vehicle.command(CONTROL)
            vehicle.advance_to(vehicle.time + 0.0101)

    return best(fly, 2000)


def batch(dynamics) -> float:
    """Return us per step and vehicle of a hundred in arrays."""
    state = dynamics.initial_state(split(np.ones((VEHICLES, 3))))
    control = split(np.tile(CONTROL, (VEHICLES, 1)))

    def fly():
        x = state
        for count in range(100):
            x = dynamics.step(count, x, control)

    return best(fly, 100 * VEHICLES)


def tick(node_class) -> float:
    """Return us per tick of 1 ms of a node, pose broadcast included, without a socket."""
    process = FakeProcess()
    parameters = {"time_step": 0.001, "frames/fixed": "world", "frames/robot": "crazyflie"}
    parameters |= {"init/x": 0.0, "init/y": 0.0, "init/z": 1.0, "topics/control": "/control"}
    process.launch(node_class(), "/simulator", parameters)
    return best(lambda: process.advance(0.5), 500)


def main() -> None:
    """Print the table."""
    rows = [
        ("near_hover", NearHover(), NearHoverSimulatorNode),
        ("coupled_7d", Coupled7D(), NearHoverSimulatorCoupled7DNode),
        ("quadrotor", StabilizedQuadrotor(), QuadrotorSimulatorNode),
        ("quadrotor, gusts", StabilizedQuadrotor(wind=Wind(gust=1.0).velocity), None),
    ]
    print(f"{'us per':18}{'step':>8}{f'step, of {VEHICLES}':>16}{'tick at rest':>16}")
    for name, dynamics, node_class in rows:
        at_rest = f"{tick(node_class):.1f}" if node_class else "-"
        print(f"{name:18}{one_vehicle(dynamics):8.1f}{batch(dynamics):16.2f}{at_rest:>16}")


if __name__ == "__main__":
    main()
