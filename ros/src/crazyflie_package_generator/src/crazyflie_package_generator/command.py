"""The command line of the generator."""

import argparse
import sys
from pathlib import Path

from crazyflie_package_generator.generator import GeneratorError, Package, create


def main(arguments: list[str] | None = None) -> int:
    """Make a package as the command line asks; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="create_package",
        description="Make a package with one node that builds, passes its tests and lints.",
    )
    parser.add_argument("name", metavar="NAME", help="of the package, such as wall_follower")
    parser.add_argument("--node", required=True, metavar="NAME", help="of its node, without _node")
    parser.add_argument("--messages", action="store_true", help="with a message of its own")
    parser.add_argument(
        "--folder", type=Path, default=Path(), help="where it is made (default: the present one)"
    )
    parser.add_argument("--maintainer", default=Package.maintainer, help="for package.xml")
    parser.add_argument("--email", default=Package.email, help="for package.xml")
    given = parser.parse_args(arguments)
    package = Package(given.name, given.node, given.messages, given.maintainer, given.email)
    try:
        folder = create(package, given.folder)
    except GeneratorError as error:
        print(f"create_package: {error}", file=sys.stderr)
        return 1
    print(f"{folder}: build it with catkin_make; its README.md says what it is")
    return 0
