"""A process of any number of nodes: their handles, their start and their end."""

from crazyflie_utils.context import ProcessContext
from crazyflie_utils.handle import NodeHandle
from crazyflie_utils.node import Node


class Process(ProcessContext):
    """A process with any number of nodes, which are passed by absolute name at its end."""

    def handle(self, name: str) -> NodeHandle:
        """Return the handle of the node with this absolute name."""
        return NodeHandle(self, name)

    def start(self) -> None:
        """Start to run callbacks: every node is complete."""
        self._steady.start()
        self.executor.start()

    def stop(self) -> None:
        """Stop all timers."""
        self._steady.stop()
        self._simulated.stop()

    def prepare_shutdown(self, nodes: dict[str, Node]) -> None:
        """Call `prepare_shutdown` of every node, and publish that flights are to end."""
        for inhibitor in self._inhibitors:
            self.executor.submit(inhibitor.publish_ending)
        for name, node in nodes.items():
            self.executor.submit(self.handle(name).guard(node.prepare_shutdown))

    def shut_down(self, nodes: dict[str, Node]) -> None:
        """Stop all timers, and make the vehicle of every node safe."""
        self.stop()
        for name, node in nodes.items():
            self.executor.submit(self.handle(name).guard(node.shutdown))
