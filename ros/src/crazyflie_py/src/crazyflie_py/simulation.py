"""The swarm of --sim: ideal vehicles, and a clock that runs as fast as possible."""

import argparse
import logging
import math
from collections.abc import Sequence

import numpy as np

from crazyflie_fleet.fleet_config import close_pairs
from crazyflie_py import arguments as check
from crazyflie_py.fleet import FleetVehicle
from crazyflie_py.simulated_vehicle import SimulatedVehicle
from crazyflie_py.swarm import Order, Swarm
from crazyflie_py.visualizer import visualizer_for
from crazyflie_utils.refusal import distinct

_log = logging.getLogger(__name__)

_ROUNDING = 1e-9  #: Fraction of a step by which a sleep may be too short, due to rounding.


class Simulation(Swarm):
    """A swarm without ROS; for options see `crazyflie_py.crazyswarm_py.build_argparser`."""

    vehicles: Sequence[SimulatedVehicle]

    def __init__(self, fleet: Sequence[FleetVehicle], options: argparse.Namespace):
        self.dt: float = options.dt
        self._steps = 0
        self._residual = 0.0
        limits = (options.maxvel, options.disturbance, set[str]())
        self.vehicles = [SimulatedVehicle(vehicle, self.time, *limits) for vehicle in fleet]
        self._buffers = [vehicle.buffer for vehicle in fleet]
        self._close: set[tuple[int, int]] = set()
        self.visualizer = visualizer_for(options.vis, has_video=options.video is not None)
        if options.video is not None:
            self.visualizer.startVideoOutput(options.video, self.dt)
        self._writes_csv: bool = options.writecsv
        self._phase = 0
        self._rows: dict[int, list[list[float]]] = {}  # Rows of the phase, by the vehicles' ids.

    def command(self, order: Order, vehicle: SimulatedVehicle | None) -> None:
        for each in self.vehicles if vehicle is None else [vehicle]:
            order.send(each)

    # The clock.

    def time(self) -> float:
        return self._steps * self.dt

    def sleep(self, duration: float) -> None:
        duration = check.number("timeHelper.sleep", "duration", duration)
        # Time passes in whole steps; the remainder of a sleep is added to the next one.
        total = max(0.0, duration) + self._residual
        steps = math.floor(total / self.dt + _ROUNDING)
        self._residual = max(0.0, total - steps * self.dt)
        for _ in range(steps):
            self._step()

    def sleepForRate(self, rateHz: float) -> None:
        self.sleep(1.0 / check.rate(rateHz))

    def _step(self):
        time = self.time()
        self.visualizer.update(time, self.vehicles)
        if self._writes_csv:
            for vehicle in self.vehicles:
                state = vehicle.state()
                row = [time, *state.position, *state.rpy]
                self._rows.setdefault(vehicle.config.id, []).append(row)
        self._steps += 1
        # All motions are computed from the same state, whatever the order.
        motions = [vehicle.next_motion(self.dt) for vehicle in self.vehicles]
        for vehicle, motion in zip(self.vehicles, motions, strict=True):
            vehicle.motion = motion
        self._report_collisions()

    def _report_collisions(self):
        """Warn when a pair comes too close, once until it is apart again."""
        positions = np.array([vehicle.motion.position for vehicle in self.vehicles])
        close = set()
        for i, j, distance, allowed in close_pairs(positions, self._buffers):
            one, two = self.vehicles[i], self.vehicles[j]
            if (i, j) not in self._close and (one.is_flying or two.is_flying):
                shown, least = distinct(distance, allowed)
                _log.warning(
                    "%s and %s are %s m apart at %.2f s; expected at least %s m (vertical "
                    "distances are halved)",
                    one.name,
                    two.name,
                    shown,
                    self.time(),
                    least,
                )
            if (i, j) in self._close or one.is_flying or two.is_flying:
                close.add((i, j))
        self._close = close

    # The ends.

    def nextPhase(self) -> None:
        self._write_phase()
        self._phase += 1

    def close(self) -> None:
        self.visualizer.finishVideoOutput()
        self._write_phase()

    def _write_phase(self):
        """Write the files cfID_phaseN.csv into the working directory, the first N is 0.

        Columns: time since the beginning of the phase (s), position (m), roll, pitch, yaw (rad).
        """
        for vehicle_id, rows in self._rows.items():
            data = np.array(rows)
            data[:, 0] -= data[0, 0]
            name = f"cf{vehicle_id}_phase{self._phase}.csv"
            np.savetxt(name, data, "%.9g", ",", header="t,x,y,z,roll,pitch,yaw")
        self._rows.clear()
