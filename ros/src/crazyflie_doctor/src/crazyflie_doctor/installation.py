"""Checks of a computer: Python, packages, network, log directory, radio."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import urlsplit

from crazyflie_doctor.finding import Finding, error, listed, warn

LEAST_FREE = 100e6  #: Below this much space the logs of a flight may not fit, bytes.

FEW_FREE = 1e9

_LOOPBACK = "127."  #: Begin of addresses that no other computer can reach.

_RULES = "sudo cp $(rospack find crazyflie_link)/udev/99-crazyflie.rules /etc/udev/rules.d/"
_SOURCE = "source devel/setup.bash (or install/setup.bash) of the workspace in this shell"


@dataclass(frozen=True)
class Python:
    """An interpreter."""

    path: str
    version: str  #: Such as 3.11; empty if it cannot be run.
    broken: Mapping[str, str]  #: Module that cannot be imported -> why.


def check_python(first: Python, of_ros: str) -> Iterator[Finding]:
    """Check the first python3 on the PATH; ``of_ros`` is the version for which ROS is installed."""
    if first.version != of_ros:
        yield error(
            f"{first.path or 'no python3'} on the PATH is Python {first.version or '?'}, "
            f"ROS is installed for {of_ros}",
            f"take other Pythons (conda, pyenv) off the PATH, then {_SOURCE}",
        )
    elif first.broken:
        reasons = listed(f"{name} ({why})" for name, why in first.broken.items())
        yield error(f"{first.path} cannot import {reasons}", f"{_SOURCE}; if it is, ./run install")


def check_packages(
    required: Mapping[str, str], installed: Mapping[str, str], remedy: str
) -> Iterator[Finding]:
    """Check packages, name -> version; an empty required version stands for any."""
    missing = [name for name in required if name not in installed]
    if missing:
        yield error(f"missing: {listed(missing, 20)}", remedy)
    for name, version in required.items():
        if version and installed.get(name, version) != version:
            yield warn(f"{name} is {installed[name]}, tested is {version}", remedy)


@dataclass(frozen=True)
class Network:
    """Network settings by which nodes of this shell find each other."""

    variables: Mapping[str, str]  #: Environment.
    hostname: str  #: Hostname of this computer.
    #: ``resolve(name)`` returns the IPv4 address of a host, empty if unknown.
    resolve: Callable[[str], str]
    #: ``is_own(address)`` tells whether this computer has the address.
    is_own: Callable[[str], bool]


def check_network(network: Network) -> Iterator[Finding]:
    """Check ROS_MASTER_URI, ROS_IP, ROS_HOSTNAME and the name of the computer."""
    variables = network.variables
    uri = variables.get("ROS_MASTER_URI", "")
    try:
        master, port = urlsplit(uri).hostname or "", urlsplit(uri).port
    except ValueError:
        master, port = "", None
    if not (master and port):
        yield error(
            f"ROS_MASTER_URI is {uri!r}", "export ROS_MASTER_URI=http://localhost:11311, or another"
        )
        return
    master_address = network.resolve(master)
    if not master_address:
        yield error(
            f"the host {master!r} of ROS_MASTER_URI is unknown",
            f"use its address, or add a line ADDRESS {master} to /etc/hosts",
        )
    yield from _check_own_name(network, master, master_address)


def _check_own_name(network, master, master_address):
    variables = network.variables
    given = [name for name in ("ROS_HOSTNAME", "ROS_IP") if variables.get(name)]
    if len(given) == 2:
        yield warn("both ROS_HOSTNAME and ROS_IP are set: ROS_HOSTNAME is used", "unset one")
    variable = given[0] if given else "hostname"
    name = variables[variable] if given else network.hostname
    address = network.resolve(name)
    if not address:
        yield error(
            f"{variable} {name!r} is unknown here: nodes cannot reach each other",
            "export ROS_IP=127.0.0.1, or this computer's address in the lab network",
        )
    elif not network.is_own(address):
        yield error(
            f"{variable} {name!r} is {address}, no address of this computer",
            "export ROS_IP with one that `hostname -I` prints, or 127.0.0.1",
        )
    elif address.startswith(_LOOPBACK) and master_address and not network.is_own(master_address):
        yield error(
            f"the master is on {master}, but nodes started here can only be reached from here "
            f"({variable} {name})",
            "export ROS_IP with this computer's address in the lab network (hostname -I)",
        )
    if not given and master_address and network.is_own(master_address):
        yield warn(
            "neither ROS_IP nor ROS_HOSTNAME is set: any computer in the network can command nodes",
            f"{_SOURCE}, or export ROS_IP=127.0.0.1",
        )


def check_log_directory(path: str, is_writable: bool, free: float) -> Iterator[Finding]:
    """Check where roslaunch and rospy write their logs; ``free`` is in bytes."""
    remedy = "export ROS_LOG_DIR to a directory of yours, or free space (rosclean purge)"
    if not is_writable:
        yield error(f"{path} cannot be written", remedy)
    elif free < FEW_FREE:
        level = error if free < LEAST_FREE else warn
        yield level(f"{free / 1e6:.0f} MB are left for {path}", remedy)


@dataclass(frozen=True)
class Radio:
    """Crazyradios of this computer, and whether they may be used."""

    #: Device file of each that is plugged in -> whether this user may use it.
    dongles: Mapping[str, bool]
    has_rules: bool  #: There is a udev rule for them.
    groups: Sequence[str]  #: This user's.


def check_radio(radio: Radio, uris: Sequence[str]) -> Iterator[Finding]:
    """Check the permission to use a Crazyradio, where there is one or a vehicle needs one."""
    radio_uris = [uri for uri in uris if uri.startswith("radio://")]
    if radio_uris and not radio.dongles:
        yield error(
            f"no Crazyradio is plugged in for {listed(radio_uris)}", "plug it in; see `lsusb`"
        )
    refused = [path for path, may in radio.dongles.items() if not may]
    if refused:
        steps = [] if radio.has_rules else [_RULES, "sudo udevadm trigger"]
        if "plugdev" not in radio.groups:
            steps.append("sudo usermod -aG plugdev $USER and log in again")
        yield error(
            f"no permission to use the Crazyradio {listed(refused)}",
            " && ".join(steps) or "unplug it and plug it in again",
        )
    elif (radio_uris or radio.dongles) and not radio.has_rules:
        yield warn("there is no udev rule for the Crazyradio: only root may use it", _RULES)
