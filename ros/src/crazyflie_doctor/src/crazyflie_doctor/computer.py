"""Reads the state of this computer: Python, packages, network, log directory, radio."""

import contextlib
import grp
import importlib.metadata
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterable
from pathlib import Path

import rospkg
from packaging.requirements import Requirement

from crazyflie_doctor.installation import Network, Python, Radio

_RESOLVER_LIMIT = 2.0  #: Longest wait for the address of a host (s).
_PROGRAM_LIMIT = 20.0  #: Longest run time of another program (s).

_MODULES = ("rospy", "tf2_ros", "numpy", "cflib", "natnet")

_PRINT_VERSION = "import sys; print('%d.%d' % sys.version_info[:2])"

_RADIO_ID = ("1915", "7777")


def first_python() -> Python:
    """Return the first python3 on the PATH."""
    path = shutil.which("python3")
    if path is None:
        return Python("", "", {})
    version = _run(path, "-c", _PRINT_VERSION)
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
    version = _run("/usr/bin/python3", "-c", _PRINT_VERSION)
    return version.strip() or "{}.{}".format(*sys.version_info)


def _run(*command):
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_PROGRAM_LIMIT, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout if done.returncode == 0 else ""


def package_sections(name: str) -> dict[str, list[str]]:
    """Return the packages of a list above this package by section; none if it is not there.

    A section begins with a line ``# [NAME] ...``; what stands before the first is of section "".
    """
    place = Path(rospkg.RosPack().get_path("crazyflie_doctor")).resolve()
    found = (folder / name for folder in place.parents if (folder / name).is_file())
    path = next(found, None)
    sections: dict[str, list[str]] = {}
    section = ""
    for line in path.read_text().splitlines() if path else ():
        if begin := re.match(r"# \[(\w+)\]", line):
            section = begin[1]
        elif text := line.partition("#")[0].strip():
            sections.setdefault(section, []).append(text)
    return sections


def debian_packages() -> dict[str, str]:
    """Return the installed Debian packages, name -> version."""
    listing = _run("dpkg-query", "-W", "-f=${Package}\t${db:Status-Status}\t${Version}\n")
    rows = [line.split("\t") for line in listing.splitlines()]
    return {name: version for name, status, version in rows if status == "installed"}


def python_packages(entries: Iterable[str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return name -> version of the packages that are asked for, and of the installed ones."""
    required, installed = {}, {}
    for requirement in map(Requirement, entries):
        if requirement.marker is None or requirement.marker.evaluate():
            exact = [s.version for s in requirement.specifier if s.operator == "=="]
            required[requirement.name] = exact[0] if exact else ""
            # A package is missing if it is required and not installed.
            with contextlib.suppress(importlib.metadata.PackageNotFoundError):
                installed[requirement.name] = importlib.metadata.version(requirement.name)
    return required, installed


def network() -> Network:
    """Return the network settings by which nodes of this shell find each other."""
    return Network(os.environ, socket.gethostname(), _resolve, _is_own)


def _resolve(name):
    """Return the address of a host; empty if the resolver does not answer within the limit."""
    addresses = []

    def resolve():
        with contextlib.suppress(OSError, UnicodeError):
            addresses.append(socket.gethostbyname(name))

    # The resolver has no time limit of its own: its thread may be left behind.
    thread = threading.Thread(target=resolve, daemon=True)
    thread.start()
    thread.join(_RESOLVER_LIMIT)
    return addresses[0] if addresses else ""


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
    """Return the Crazyradios of this computer, and whether this user may use them."""
    dongles = {}
    for device in (root / "sys/bus/usb/devices").glob("*"):
        # Some entries have no vendor and product, and a device may be unplugged meanwhile.
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
