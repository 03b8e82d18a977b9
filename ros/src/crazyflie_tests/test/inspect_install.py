"""Look at an install space from within: what is wrong is printed, and makes the status 1.

Usage: inspect_install.py INSTALL_SPACE PACKAGE ...
"""

import importlib
import pkgutil
import sys
from pathlib import Path
from xml.etree import ElementTree

import rospkg
from roslaunch.config import load_config_default
from roslib.packages import find_node


def wrong_modules(space: Path, packages: list[str]) -> list[str]:
    """Return what is wrong with the Python modules of the packages: all are imported."""
    complaints = []
    for package in packages:
        try:
            names = [package]
            path = importlib.import_module(package).__path__
            names += [found.name for found in pkgutil.walk_packages(path, package + ".")]
        except ModuleNotFoundError as error:
            # A package of launch files has no modules.
            if error.name != package:
                complaints.append(str(error))
            continue
        for name in names:
            if name.endswith("__main__"):
                continue  # It would run.
            home = importlib.import_module(name).__file__
            if Path(home).is_relative_to(sys.prefix):
                continue  # PyPI's; the package of this name stands in for it and has no modules.
            if not home.startswith(f"{space}/"):
                complaints.append(f"{name} is {home}")
    return complaints


def wrong_launch_files(space: Path, packages: list[str]) -> list[str]:
    """Return what is wrong with the launch files: those without required arguments are expanded."""
    complaints = []
    finder = rospkg.RosPack()
    for package in packages:
        folder = Path(finder.get_path(package))
        if not folder.is_relative_to(space):
            complaints.append(f"{package} is {folder}")
        for file in sorted(folder.glob("launch/*.launch")):
            if _is_fragment(file):
                continue
            config = load_config_default([(str(file), [])], None, False, False)
            complaints += [
                f"{file.name}: there is no {node.type} in {node.package}"
                for node in config.nodes
                if node.package in packages and not find_node(node.package, node.type, finder)
            ]
    return complaints


def _is_fragment(file):
    arguments = ElementTree.parse(file).getroot().findall("arg")
    return any("default" not in each.attrib and "value" not in each.attrib for each in arguments)


def main(space: str, *packages: str) -> int:
    """Print what is wrong; return the exit status."""
    complaints = wrong_modules(Path(space), packages) + wrong_launch_files(Path(space), packages)
    print("\n".join(complaints))
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
