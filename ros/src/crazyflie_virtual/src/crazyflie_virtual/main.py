"""Main programs: with ROS when roslaunch starts them, without otherwise."""

import signal
import sys
from collections.abc import Callable

from crazyflie_utils.parameters.command_line import parse_arguments
from crazyflie_utils.parameters.declaration import ParameterError, Parameters
from crazyflie_virtual.server import Server

_DESCRIPTION = (
    "A Crazyflie in software that speaks CRTP over UDP: connect with any cflib program to "
    "udp://HOST:PORT."
)

_MOCAP_DESCRIPTION = (
    "A motion capture system in software: streams the true poses of the virtual vehicles on this "
    "machine as a NatNet server."
)


def virtual_crazyflie() -> None:
    """Run a virtual vehicle until interrupted."""
    if _ran_as_node("crazyflie_virtual.vehicle_node:VirtualCrazyflieNode", "virtual_crazyflie"):
        return
    from crazyflie_virtual.link.server import VehicleServer
    from crazyflie_virtual.settings import VehicleSettings

    _run("virtual_crazyflie", _DESCRIPTION, VehicleSettings, VehicleServer)


def virtual_mocap() -> None:
    """Run a virtual motion capture system until interrupted."""
    if _ran_as_node("crazyflie_virtual.mocap.mocap_node:VirtualMocapNode", "virtual_mocap"):
        return
    from crazyflie_virtual.mocap.server import MocapServer
    from crazyflie_virtual.mocap.settings import MocapSettings

    _run("virtual_mocap", _MOCAP_DESCRIPTION, MocapSettings, MocapServer)


def _ran_as_node(node_type: str, name: str) -> bool:
    # roslaunch gives every node its name this way; parameters for rosrun look alike.
    if not any(":=" in argument for argument in sys.argv[1:]):
        return False
    from crazyflie_utils import run

    run(node_type, name)
    return True


def _run(
    program: str,
    description: str,
    settings_type: type[Parameters],
    server_type: Callable[..., Server],
) -> None:
    settings = parse_arguments(settings_type, sys.argv[1:], program, description)
    try:
        server = server_type(settings, lambda text: print(text, file=sys.stderr, flush=True))
    except OSError as error:
        sys.exit(f"{program}: cannot listen: {error}")
    except ParameterError as error:
        sys.exit(f"{program}: {error}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    print(server.description, flush=True)
    try:
        server.run()
    except KeyboardInterrupt:
        # Ctrl-C is how it ends.
        pass
