"""Main programs: one node in a process, or many."""

import importlib
import sys
import threading

import rosgraph
import rospy

from crazyflie_utils.parameters import BOOLEAN, ParameterError
from crazyflie_utils.process import Process
from crazyflie_utils.ros_transport import RosTransport

_MASTER_LIMIT = 10.0
"""How long, in s, a node waits for a ROS master."""


def run(node_class: type, default_name: str) -> None:
    """Run one node in this process until ROS shuts down; does not return.

    Exits with status 1 when the node cannot be initialized.

    Parameters
    ----------
    node_class : type
        Subclass of `Node`.
    default_name : str
        Name of the node unless the launch file gives another.
    """
    process = begin(default_name)
    _run(process, {rospy.get_name(): node_class()})


def run_composed(default_name: str) -> None:
    """Run the nodes that the private parameter ``nodes`` lists; does not return.

    ``nodes`` maps a node's name, relative to this process's namespace, to its
    class as "package.module:Class". Each node has the parameters, topics and
    services it would have in a process of its own.
    """
    process = begin(default_name)
    handle = process.handle(rospy.get_name())
    try:
        classes = handle.param("nodes", NodeClasses())
    except ParameterError as error:
        handle.error(str(error))
        _fail()
    _run(process, {handle.resolve(name): node() for name, node in classes.items()})


class NodeClasses:
    """Kind of the parameter that lists the nodes of a process."""

    def __call__(self, value) -> dict:
        """Return node name -> node class."""
        if not isinstance(value, dict) or not value:
            raise ValueError
        return {name: _import_class(path) for name, path in _flatten(value).items()}

    def __str__(self) -> str:
        """Return what is expected."""
        return 'a dictionary of node name: "package.module:Class"'


def _flatten(tree, prefix=""):
    # A name such as cf1/simulator is a tree to the parameter server.
    leaves = {}
    for key, value in tree.items():
        if isinstance(value, dict):
            leaves.update(_flatten(value, f"{prefix}{key}/"))
        else:
            leaves[prefix + key] = value
    return leaves


def _import_class(path):
    module, _, name = str(path).partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"no class {path!r}: {error}") from error


def begin(default_name: str) -> Process:
    """Make this process a ROS node and return what its nodes share, not yet started.

    Exits with status 1 when there is no ROS master.
    """
    _wait_for_master()
    rospy.init_node(default_name)
    return ros_process()


def ros_process() -> Process:
    """Return what the nodes of this process share, when it is a ROS node already."""
    transport = RosTransport()
    try:
        use_sim_time = BOOLEAN(transport.get_param("/use_sim_time"))
    except KeyError:
        use_sim_time = False
    except ValueError:
        transport.log("error", f"parameter /use_sim_time: expected {BOOLEAN}")
        _fail()
    return Process(transport, use_sim_time)


def _wait_for_master():
    patience = threading.Event()
    waited = 0.0
    while not rosgraph.is_master_online():
        if waited == 0.0:
            print(f"waiting for a ROS master at {rosgraph.get_master_uri()}", file=sys.stderr)
        if waited >= _MASTER_LIMIT:
            sys.exit(
                f"no ROS master at {rosgraph.get_master_uri()} after {_MASTER_LIMIT:g} s; "
                "start one with roscore or roslaunch"
            )
        patience.wait(0.5)
        waited += 0.5


def _run(process, nodes):
    for name, node in nodes.items():
        if not node.initialize(process.handle(name)):
            process.transport.log("fatal", f"{name}: not initialized; the process exits")
            _fail()

    def end():
        process.stop()
        process.executor.submit(lambda: [node.shutdown() for node in nodes.values()])

    rospy.on_shutdown(end)
    process.start()
    rospy.spin()
    sys.exit(0)


def _fail():
    rospy.signal_shutdown("failed to initialize")
    sys.exit(1)
