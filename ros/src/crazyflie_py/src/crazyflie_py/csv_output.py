"""What --writecsv writes: a file for each vehicle and phase."""

from collections.abc import Iterable

import numpy as np

from crazyflie_py.simulated_vehicle import SimulatedVehicle


class CsvOutput:
    """Files cfID_phaseN.csv in the working directory.

    Columns: time since the beginning of the phase (s), position (m), roll, pitch, yaw (rad).
    ``timeHelper.nextPhase()`` begins a phase; a script without it has one, number 0.
    """

    def __init__(self) -> None:
        self._phase = 0
        self._rows: dict[int, list[list[float]]] = {}

    def update(self, time: float, vehicles: Iterable[SimulatedVehicle]) -> None:
        """Add a row for each vehicle."""
        for vehicle in vehicles:
            state = vehicle.state()
            row = [time, *state.position, *state.rpy]
            self._rows.setdefault(vehicle.id, []).append(row)

    def next_phase(self) -> None:
        """Write the present phase, and begin the next one."""
        self.close()
        self._phase += 1

    def close(self) -> None:
        """Write the present phase."""
        for vehicle_id, rows in self._rows.items():
            data = np.array(rows)
            data[:, 0] -= data[0, 0]
            name = f"cf{vehicle_id}_phase{self._phase}.csv"
            np.savetxt(name, data, "%.9g", ",", header="t,x,y,z,roll,pitch,yaw")
        self._rows.clear()
