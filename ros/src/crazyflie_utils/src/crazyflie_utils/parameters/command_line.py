"""Parameters from a command line, by the same declaration as from the parameter server."""

import argparse
from typing import TypeVar

from crazyflie_utils.parameters.declaration import REQUIRED, ParameterError, Parameters

P = TypeVar("P", bound=Parameters)


def parse_arguments(parameters: type[P], arguments: list[str], program: str, description: str) -> P:
    """Return the parameters on a command line: ``init/x`` is the argument ``--init-x``.

    ``program`` and ``description`` are for ``--help``. Exits with status 2 and a message about all
    that is wrong.
    """
    parser = argparse.ArgumentParser(prog=program, description=description)
    declarations = {_option(d.name): d for d in parameters.declarations()}
    for option, declaration in declarations.items():
        parser.add_argument(
            option,
            dest=declaration.name,
            default=argparse.SUPPRESS,
            metavar=declaration.type.label.upper(),
            help=_help(declaration),
        )
    given = vars(parser.parse_args(arguments))

    def get(name):
        text = given[name]
        try:
            return types[name].from_text(text)
        except ValueError:
            # The type refuses the text as well, and says what it expects.
            return text

    types = {declaration.name: declaration.type for declaration in declarations.values()}
    try:
        return parameters.read(get, _option)
    except ParameterError as error:
        parser.error(str(error))


def _option(name):
    return "--" + name.replace("/", "-").replace("_", "-")


def _help(declaration):
    unit = f", {declaration.type.unit}" if declaration.type.unit else ""
    default = "" if declaration.default is REQUIRED else f" (default: {declaration.default})"
    # argparse formats the text with %.
    return f"{declaration.help}{unit}{default}".replace("%", "%%")
