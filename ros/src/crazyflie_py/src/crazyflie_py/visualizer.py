"""What --sim draws with."""

from collections.abc import Sequence

from crazyflie_py.simulated_vehicle import SimulatedVehicle


class NullVisualizer:
    """Draws nothing."""

    def setGraph(self, edges: Sequence[tuple[int, int]]) -> None:
        """Draw no lines."""

    def showEllipsoids(self, radii: Sequence[float]) -> None:
        """Draw no ellipsoids."""

    def startVideoOutput(self, path: str, dt: float) -> None:
        """Write no video."""

    def finishVideoOutput(self) -> None:
        """End no video."""

    def update(self, t: float, crazyflies: Sequence[SimulatedVehicle]) -> None:
        """Draw nothing at a time, s."""


def visualizer_for(name: str, has_video: bool) -> NullVisualizer:
    """Return the visualizer of a name, "mpl", "vispy" or "null"."""
    return NullVisualizer()
