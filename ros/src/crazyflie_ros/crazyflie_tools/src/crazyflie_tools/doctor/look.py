"""Gathers what the checks of an installation and of a graph are about; nothing here waits long."""

import contextlib
import grp
import importlib.metadata
import io
import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit
from xmlrpc.client import ServerProxy

import rosgraph
import roslib.message
import rospkg
from packaging.requirements import Requirement
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header

from crazyflie_tools.doctor.graph import Graph, Type
from crazyflie_tools.doctor.installation import Network, Python, Radio

LIMIT = 2.0
"""How long to wait for any one answer, s."""

_PROGRAM_LIMIT = 20.0
"""How long another program may take, s."""

_MODULES = ("rospy", "tf2_ros", "numpy", "scipy", "cflib", "control", "natnet")

_AT_A_TIME = 16

_NAME = "/doctor"

_RADIO_ID = ("1915", "7777")

T = TypeVar("T")


def first_python() -> Python:
    """Return the first python3 on the PATH."""
    path = shutil.which("python3")
    if path is None:
        return Python("", "", {})
    version = _run(path, "-c", "import sys; print('%d.%d' % sys.version_info[:2])")
    code = (
        "import importlib, sys\n"
        "for name in sys.argv[1:]:\n"
        "    try: importlib.import_module(name)\n"
        "    except Exception as error: print(name, repr(error), sep='\\t')\n"
    )
    lines = _run(path, "-c", code, *_MODULES).splitlines()
    return Python(path, version.strip(), dict(line.split("\t", 1) for line in lines))


def python_of_ros() -> str:
    """Return the version of the Python that Debian's ROS is for; this one's where ROS is not."""
    version = _run("/usr/bin/python3", "-c", "import sys; print('%d.%d' % sys.version_info[:2])")
    return version.strip() or "{}.{}".format(*sys.version_info)


def _run(*command):
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_PROGRAM_LIMIT, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""


def package_list(name: str) -> list[str]:
    """Return the entries of a list of packages above this package; none if it is not there."""
    place = Path(rospkg.RosPack().get_path("crazyflie_tools")).resolve()
    for folder in place.parents:
        if (folder / name).is_file():
            lines = (folder / name).read_text().splitlines()
            return [text for line in lines if (text := line.partition("#")[0].strip())]
    return []


def debian_packages() -> dict[str, str]:
    """Return the installed Debian packages, name -> version."""
    listing = _run("dpkg-query", "-W", "-f=${Package}\t${db:Status-Status}\t${Version}\n")
    rows = [line.split("\t") for line in listing.splitlines()]
    return {name: version for name, status, version in rows if status == "installed"}


def python_packages(entries: Iterable[str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return name -> version of the packages that are asked for, and of the installed ones."""
    wanted, installed = {}, {}
    for requirement in map(Requirement, entries):
        if requirement.marker is None or requirement.marker.evaluate():
            exact = [s.version for s in requirement.specifier if s.operator == "=="]
            wanted[requirement.name] = exact[0] if exact else ""
            # What is missing is what is wanted and not installed.
            with contextlib.suppress(importlib.metadata.PackageNotFoundError):
                installed[requirement.name] = importlib.metadata.version(requirement.name)
    return wanted, installed


def network() -> Network:
    """Return what decides how nodes of this shell find each other."""
    return Network(os.environ, socket.gethostname(), _resolve, _is_own)


def _resolve(name):
    # The resolver knows no time limit: it is asked in a thread that may be left behind.
    return _within(LIMIT, lambda: socket.gethostbyname(name), "")


def _within(limit: float, work: Callable[[], T], otherwise: T) -> T:
    results: list[T] = []

    def attempt():
        # A failure is told by ``otherwise``.
        with contextlib.suppress(OSError, UnicodeError):
            results.append(work())

    thread = threading.Thread(target=attempt, daemon=True)
    thread.start()
    thread.join(limit)
    return results[0] if results else otherwise


def _is_own(address):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return False
        return True


def log_directory() -> tuple[str, bool, float]:
    """Return where logs go, whether that can be written, and how many bytes are free there."""
    path = Path(rospkg.get_log_dir())
    existing = next(folder for folder in (path, *path.parents) if folder.exists())
    may_write = existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)
    return str(path), may_write, shutil.disk_usage(existing).free


def radio(root: Path = Path("/")) -> Radio:
    """Return the Crazyradios of this computer, and who may use them."""
    dongles = {}
    for device in (root / "sys/bus/usb/devices").glob("*"):
        # Not everything there is a device with an identity, and any may be unplugged meanwhile.
        with contextlib.suppress(OSError, ValueError):
            identity = tuple(_text(device / f"id{key}") for key in ("Vendor", "Product"))
            if identity == _RADIO_ID:
                bus, number = int(_text(device / "busnum")), int(_text(device / "devnum"))
                file = root / f"dev/bus/usb/{bus:03}/{number:03}"
                dongles[str(file)] = os.access(file, os.R_OK | os.W_OK)
    rules = [
        file
        for folder in ("etc/udev/rules.d", "lib/udev/rules.d", "usr/lib/udev/rules.d")
        for file in (root / folder).glob("*.rules")
        if _RADIO_ID[0] in file.read_text(errors="replace")
    ]
    names = [group.gr_name for group in grp.getgrall() if group.gr_gid in os.getgroups()]
    return Radio(dongles, bool(rules), names)


def _text(file):
    return file.read_text().strip()


def own_md5(kind: str, name: str) -> str | None:
    """Return the MD5 sum of a message ("msg") or service ("srv") type here; None if unknown."""
    get = {"msg": roslib.message.get_message_class, "srv": roslib.message.get_service_class}[kind]
    try:
        found = get(name)
    except Exception:
        # Whatever goes wrong while somebody's module is imported.
        found = None
    return found and found._md5sum


def is_master_online() -> bool:
    """Tell whether a ROS master answers in time."""
    with _limited():
        try:
            return rosgraph.is_master_online()
        except Exception:
            # An URI that is none.
            return False


@contextlib.contextmanager
def _limited():
    """Have sockets made within give up; rospy's own, made later, must not."""
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(LIMIT)
    try:
        yield
    finally:
        socket.setdefaulttimeout(before)


def graph() -> Graph:
    """Ask the master and all nodes, many at a time.

    Raises
    ------
    OSError, rosgraph.MasterException
        The master does not answer.
    """
    with _limited():
        return _graph(rosgraph.Master(_NAME))


def _graph(master):
    publishers, subscribers, services = (
        {name: set(nodes) for name, nodes in part} for part in master.getSystemState()
    )
    parameters = dict(_flatten("", master.getParam("/")))
    nodes = set().union(*publishers.values(), *subscribers.values(), *services.values())
    with ThreadPoolExecutor(_AT_A_TIME) as executor:
        answers = dict(zip(nodes, executor.map(_ask, nodes), strict=True))
        silent = {node: answer for node, answer in answers.items() if isinstance(answer, str)}
        pairs = [(n, t) for t, names in publishers.items() for n in names - silent.keys()]
        offers = list(executor.map(lambda pair: _offer(answers[pair[0]][0], pair[1]), pairs))
        served = {name: min(owners) for name, owners in services.items()}
        alive = [name for name, node in served.items() if node not in silent]
        headers = list(executor.map(_service_type, alive))
    connections = {
        (node, row[4], row[1])
        for node, answer in answers.items()
        if node not in silent
        for row in answer[1]
        if row[2] == "o" and row[5:6] != [False]
    }
    return Graph(
        publishers=publishers,
        subscribers=subscribers,
        services=served,
        parameters=parameters,
        silent=silent,
        topic_types={p: o for p, o in zip(pairs, offers, strict=True) if o},
        service_types={s: h for s, h in zip(alive, headers, strict=True) if h},
        connections=connections,
    )


def _flatten(prefix, tree):
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from _flatten(f"{prefix}/{key}", value)
        else:
            yield f"{prefix}/{key}", value


def _ask(node: str) -> tuple[str, list[Any]] | str:
    """Return address and connections of a node; a text if it does not answer."""
    try:
        # A proxy of the master serves one thread only.
        uri = rosgraph.Master(_NAME).lookupNode(node)
        answer: Any = ServerProxy(uri).getBusInfo(_NAME)
        return uri, answer[2]
    except Exception as error:
        # Anything that listens on the port of a node that is no more.
        return str(error) or type(error).__name__


def _offer(uri: str, topic: str) -> Type | None:
    """Return the type that a publisher offers; None if it cannot be asked."""
    # Anything may listen on that port. Publishers that do not answer are found by `_ask`.
    with contextlib.suppress(Exception):
        answer: Any = ServerProxy(uri).requestTopic(_NAME, topic, [["TCPROS"]])
        _, host, port = answer[2]
        with socket.create_connection((host, port), LIMIT) as connection:
            return _handshake(connection, {"topic": topic})
    return None


def _service_type(service: str) -> Type | None:
    # Likewise.
    with contextlib.suppress(Exception):
        uri = urlsplit(rosgraph.Master(_NAME).lookupService(service))
        with socket.create_connection((uri.hostname or "", uri.port or 0), LIMIT) as connection:
            return _handshake(connection, {"service": service, "probe": "1"})
    return None


def _handshake(connection: socket.socket, fields: dict[str, str]) -> Type | None:
    header = {**fields, "md5sum": "*", "type": "*", "callerid": _NAME}
    write_ros_handshake_header(connection, header)
    answer: Mapping[str, Any] = read_ros_handshake_header(connection, io.BytesIO(), 4096)
    if "type" not in answer or "md5sum" not in answer:
        return None
    return answer["type"], answer["md5sum"]
