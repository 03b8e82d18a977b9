"""The set of viable states of one axis, computed by hj-reachability on a grid.

    python3 hj_level_set.py FILE.npz TAU BRAKING DISTURBANCE WALL POINTS

writes velocities, accelerations and the largest positions, shape (velocities, accelerations), that
are viable between walls at -WALL and WALL. The value is linear in the position where one wall
counts, and so needs few points there. It bends along velocity and acceleration: with 81 and 41
points edges are wrong by up to 5 mm, with 161 and 81 by 0.7 mm.
"""

import sys

import hj_reachability as hj
import jax.numpy as jnp
import numpy as np

DURATION = 2.5  #: Time in which the vehicle stops (s).
LARGEST = (0.7, 1.9, 1.4)  #: Of the grid: position, velocity and acceleration.


class Axis(hj.ControlAndDisturbanceAffineDynamics):
    """p' = v, v' = a + d, a' = (u - a) / tau."""

    def __init__(self, tau, braking, disturbance):
        self._tau = tau
        sets = (
            hj.sets.Box(jnp.array([-most]), jnp.array([most])) for most in (braking, disturbance)
        )
        super().__init__("max", "min", *sets)

    def open_loop_dynamics(self, state, time):
        _, v, a = state
        return jnp.array([v, a, -a / self._tau])

    def control_jacobian(self, state, time):
        return jnp.array([[0.0], [0.0], [1.0 / self._tau]])

    def disturbance_jacobian(self, state, time):
        return jnp.array([[0.0], [1.0], [0.0]])


def main():
    path, *numbers = sys.argv[1:]
    tau, braking, disturbance, wall = map(float, numbers[:4])
    points = int(numbers[4])
    largest = jnp.array(LARGEST)
    grid = hj.Grid.from_lattice_parameters_and_boundary_conditions(
        hj.sets.Box(-largest, largest), (29, points, points // 2 + 1)
    )
    settings = hj.SolverSettings.with_accuracy(
        "very_high", hamiltonian_postprocessor=hj.solver.backwards_reachable_tube
    )
    room = wall - jnp.abs(grid.states[..., 0])
    dynamics = Axis(tau, braking, disturbance)
    values = np.asarray(hj.step(settings, dynamics, grid, 0.0, room, -DURATION, progress_bar=False))
    p, v, a = map(np.asarray, grid.coordinate_vectors)
    edges = np.full(values.shape[1:], np.nan)
    for at in np.ndindex(edges.shape):
        column = values[:, *at]
        (viable,) = np.nonzero(column >= 0.0)
        if len(viable):
            k = viable[-1]
            edges[at] = p[k] + (p[k + 1] - p[k]) * column[k] / (column[k] - column[k + 1])
    np.savez(path, velocities=v, accelerations=a, edges=edges)


if __name__ == "__main__":
    main()
