"""Command lines of declared parameters."""

import argparse
from typing import TypeVar

from crazyflie_utils.parameters.declaration import REQUIRED, ParameterError, Parameters
from crazyflie_utils.parameters.types import BOOLEAN

P = TypeVar("P", bound=Parameters)


def parse_arguments(parameters: type[P], arguments: list[str], program: str, description: str) -> P:
    """Return the parameters on a command line: ``init/x`` is the argument ``--init-x``.

    ``program`` and ``description`` are for ``--help``. Exits with status 2 and a message that lists
    all errors.
    """
    parser = argparse.ArgumentParser(prog=program, description=description)
    types = {}
    for declaration in parameters.declarations():
        types[declaration.name] = declaration.type
        unit = f", {declaration.type.unit}" if declaration.type.unit else ""
        default = "" if declaration.default is REQUIRED else f" (default: {declaration.default})"
        parser.add_argument(
            _option(declaration.name),
            dest=declaration.name,
            default=argparse.SUPPRESS,
            metavar=declaration.type.label.upper(),
            # argparse formats the text with %.
            help=f"{declaration.help}{unit}{default}".replace("%", "%%"),
        )
    given = vars(parser.parse_args(arguments))
    try:
        return parameters.read(lambda name: _raw(types[name], given[name]), _option)
    except ParameterError as error:
        parser.error(str(error))


def _raw(parameter_type, text):
    """Return the raw value of a word on a command line."""
    if parameter_type is BOOLEAN:
        return {"true": True, "false": False}.get(text.lower(), text)
    return text


def _option(name):
    return "--" + name.replace("/", "-").replace("_", "-")
