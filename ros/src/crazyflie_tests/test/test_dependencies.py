"""Everything the workspace uses from the system or from PyPI is in its lists.

A package that was installed by hand would hide a missing line from every other
test on that machine. So the lists are compared with what Debian says of its packages.
"""

import ast
import functools
import importlib
import importlib.metadata
import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from packaging.requirements import Requirement
from workspaces import TOP

from crazyflie_doctor.computer import package_sections
from crazyflie_utils.testing.launch_files import composed_nodes, expand

ROS = TOP / "ros"
SOURCES = ROS / "src"
SHARE = Path("/usr/share")


def lines(path):
    """Return the lines of a list without comments, without the empty ones."""
    texts = (line.partition("#")[0].strip() for line in path.read_text().splitlines())
    return [text for text in texts if text]


def output(*command):
    """Return what a command prints."""
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout


@functools.cache
def installed_by_the_list(*sections):
    """Return the Debian packages that sections of ros/debian.txt bring, by default all of them."""
    listed = package_sections("debian.txt")
    packages = [package for name in sections or listed for package in listed[name]]
    text = output("apt-cache", "depends", "--recurse", "--important", "--installed", *packages)
    return {line.strip() for line in text.splitlines() if not line.startswith((" ", "<", "|"))}


@functools.cache
def owners():
    """Return the Debian package that each installed file belongs to."""
    parts = (line.partition(": ") for line in output("dpkg-query", "-S", "*").splitlines())
    return {path: package.partition(":")[0] for package, _, path in parts}


def owner(path):
    """Return the Debian package that a file belongs to; None for none."""
    return owners().get(str(path))


def files(*suffixes):
    """Return the paths of the repository's files with one of the suffixes."""
    paths = (TOP / name for name in output("git", "-C", str(TOP), "ls-files").splitlines())
    return [path for path in paths if path.suffix in suffixes and path.is_file()]


def manifests():
    """Return the package.xml files, parsed."""
    return [
        ElementTree.parse(path).getroot() for path in files(".xml") if path.name == "package.xml"
    ]


def own_packages():
    """Return the names of the packages in this repository."""
    return {manifest.findtext("name") for manifest in manifests()}


def named_in_launch_files():
    """Return the packages that launch and test files name."""
    text = "".join(path.read_text() for path in files(".launch", ".test"))
    return set(re.findall(r'pkg="([a-z0-9_]+)"', text)) | set(
        re.findall(r"\$\(find ([a-z0-9_]+)\)", text)
    )


def named_in_manifests():
    """Return the dependencies that the package.xml files name."""
    return {
        child.text for manifest in manifests() for child in manifest if child.tag.endswith("depend")
    }


OF_DEBIAN = {"eigen": "libeigen3-dev"}
"""rosdep's name of a package -> Debian's, where they differ."""

SYSTEM_PACKAGES = sorted((named_in_launch_files() | named_in_manifests()) - own_packages())


def imports():
    """Return the top-level modules that the repository's Python files import."""
    found = set()
    programs = [
        path
        for path in files("", ".py")
        if path.suffix == ".py" or path.read_bytes().startswith(b"#!/usr/bin/env python")
    ]
    for path in programs:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {name.name.partition(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                found.add(node.module.partition(".")[0])
    # A long test of crazyflie_geofence installs JAX in an environment of its own.
    return found - set(sys.stdlib_module_names) - {"hj_reachability", "jax"}


def debian_file(module):
    """Return the file of a module that Debian has installed; None for any other module."""
    spec = importlib.util.find_spec(module)
    if spec is None and module == "motioncapture":
        return None  # PyPI has it for some processors and Pythons only.
    assert spec is not None, f"there is no module {module}"
    place = spec.origin or next(iter(spec.submodule_search_locations))
    return place if place.startswith("/usr/lib/python3/dist-packages/") else None


OWN_MODULES = {path.stem for path in files(".py")} | {
    path.name
    for folder in (SOURCES, TOP / "docs")
    for path in folder.glob("**/src/*")
    if path.is_dir()
}
MODULES = sorted(imports() - OWN_MODULES - own_packages())


@pytest.mark.parametrize("name", SYSTEM_PACKAGES)
def test_packages_of_launch_files_and_manifests_are_in_the_list(name):
    # It is a ROS package, with a manifest or with messages only, or one of Debian's, or PyPI's.
    # The manifest may be in a -dev package that is installed for something else, as ros-core is.
    manifest = SHARE / name / "package.xml"
    owners = {owner(manifest)} if manifest.exists() else set()
    if importlib.util.find_spec(name):
        owners.add(owner(debian_file(name)))
    if owners:
        assert owners & installed_by_the_list()
    else:
        pip_name = re.sub("^python3-|-pip$", "", name)
        assert OF_DEBIAN.get(name, name) in installed_by_the_list() or pip_name in locked_versions()


@pytest.mark.parametrize("module", MODULES)
def test_modules_that_are_imported_are_in_the_lists(module):
    file = debian_file(module)
    # Packages that are not from Debian are from the virtual environment, which has no others.
    assert file is None or owner(file) in installed_by_the_list()


@pytest.mark.parametrize(
    "program",
    "catkin_make catkin_lint check_urdf dot git roslaunch rostest rviz Xvfb xauth".split(),
)
def test_programs_are_in_the_list(program):
    path = shutil.which(program)
    assert path, f"{program} is not installed"
    base = {"git"}  # There is no clone without it.
    assert program in base or owner(Path(path).resolve()) in installed_by_the_list()


FLIGHTS = {
    "sw_controller": (
        ["demo"],
        {"composed": True, "publish_base_link": False},
        ["crazyflie_dev.demo"],
    ),
    "virtual_hw_hover": (
        ["demo", "vehicles"],
        {"composed": True},
        ["crazyflie_driver.server_node", "crazyflie_virtual.nodes"],
    ),
    "sw_swarm": (
        ["demo", "vehicles"],
        {},
        [
            "crazyflie_dev.mission",
            "crazyflie_mission_api.mission_runner",
            "crazyflie_fleet.fleet_process",
        ],
    ),
}
"""A launch file -> sections of debian.txt that suffice, arguments, modules in addition to its
nodes."""


@pytest.mark.parametrize("flight", FLIGHTS)
def test_a_flight_needs_no_other_section(flight):
    sections, arguments, programs = FLIGHTS[flight]
    brought = installed_by_the_list(*sections)
    launch_file = SOURCES / "crazyflie_examples" / "launch" / f"{flight}.launch"
    nodes, parameters = expand(launch_file, rviz=False, record=True, **arguments)
    for package in {node.package for node in nodes.values()} - own_packages():
        assert owner(SHARE / package / "package.xml") in brought
    modules = {path.partition(":")[0] for path in composed_nodes(parameters).values()}
    import_without_others([*programs, *modules], brought)


def import_without_others(modules, brought):
    """Import modules with nothing of Debian but its packages that were brought."""
    # A module that is None in sys.modules is treated as not installed. If Debian's package of a
    # module that is in requirements.txt is not installed either, pip installs it.
    absent = [
        module
        for module in set(MODULES) - set(locked_versions())
        if (file := debian_file(module)) and owner(file) not in brought
    ]
    assert {"cv2", "llvmlite", "pytest"} <= set(absent)
    output(
        *(sys.executable, "-c"),
        f"import importlib, sys; sys.modules.update(dict.fromkeys({absent}))\n"
        f"for name in {modules}: importlib.import_module(name)",
    )


@pytest.mark.parametrize(
    ("word", "module"),
    [
        ("identify", "crazyflie_identification.command"),
        ("journal", "crazyflie_reports.journal_program"),
        ("replay", "crazyflie_reports.replay_program"),
        ("doctor", "crazyflie_doctor.program"),
        ("first_flight", "crazyflie_examples.first_flight_program"),
        ("fly", "crazyflie_dashboard.page"),
    ],
)
def test_a_word_of_run_installs_what_its_program_needs(word, module):
    text = (ROS.parent / "run").read_text()
    names = "|".join(package_sections("debian.txt"))
    sections = re.search(
        rf'^{word}\(\) {{\s+(?:start|ready) "?((?:(?:{names}) ?)+)', text, re.MULTILINE
    )
    import_without_others([module], installed_by_the_list(*sections[1].split()))


def locked_versions():
    """Return name -> version of ros/requirements.txt, for this machine."""
    requirements = map(Requirement, lines(ROS / "requirements.txt"))
    return {
        normalized(wanted.name): next(iter(wanted.specifier)).version
        for wanted in requirements
        if wanted.marker is None or wanted.marker.evaluate()
    }


def normalized(name):
    """Return the name of a PyPI package as PEP 503 compares names."""
    return re.sub(r"[-_.]+", "-", name).lower()


TOOLS = {"pip", "setuptools"}
"""Packages that Python itself puts into a virtual environment."""


def test_the_virtual_environment_is_the_list():
    folder = next((ROS / ".venv" / "lib").glob("python3.*/site-packages"))
    found = {
        normalized(d.name): d.version for d in importlib.metadata.distributions(path=[str(folder)])
    }
    assert {name: version for name, version in found.items() if name not in TOOLS} == {
        name: version for name, version in locked_versions().items() if name in found
    }
    # pip leaves out a package that Debian has in that very version.
    assert not {
        name
        for name, version in locked_versions().items()
        if name not in found and not is_installed(name, version)
    }


def is_installed(name, version):
    try:
        # As for pip, 4.4.5+dfsg of Debian is 4.4.5.
        return importlib.metadata.version(name).partition("+")[0] == version
    except importlib.metadata.PackageNotFoundError:
        return False


@pytest.mark.parametrize("name", sorted(locked_versions()))
def test_the_list_has_all_that_its_packages_pull_in(name):
    for requirement in importlib.metadata.requires(name) or []:
        needed, _, condition = requirement.partition(";")
        if "extra ==" not in condition and "python_version" not in condition:
            # Raises PackageNotFoundError when it is neither locked nor from Debian.
            assert importlib.metadata.version(re.split(r"[<>=!~ (\[]", needed)[0])


@pytest.mark.parametrize("module", ["cv2", "cv_bridge", "cv_bridge.boost.cv_bridge_boost"])
def test_compiled_modules_of_debian_work_in_the_sourced_environment(module):
    # They are built for Debian's numpy, as the nodes are that users have.
    assert importlib.import_module(module)


def test_cv_bridge_makes_an_array_of_an_image():
    import numpy as np
    from cv_bridge import CvBridge
    from sensor_msgs.msg import Image

    image = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    message = Image(height=2, width=2, encoding="bgr8", step=6, data=image.tobytes())
    assert (CvBridge().imgmsg_to_cv2(message) == image).all()


def test_tf_transformations_work_in_the_sourced_environment():
    from tf.transformations import euler_from_quaternion, quaternion_from_euler

    angles = (0.3, -0.4, 1.1)
    assert euler_from_quaternion(quaternion_from_euler(*angles)) == pytest.approx(angles)
