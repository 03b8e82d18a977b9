"""Options: declared once, read from a command line or from ROS parameters.

A class of options is a frozen dataclass whose fields are made with `option`. An
option ``init/x`` is the field ``init_x``, the argument ``--init-x`` and the
parameter ``~init/x``.
"""

import argparse
import dataclasses
import math


def option(
    default,
    text: str,
    key: str = "",
    minimum: float = -math.inf,
    maximum: float = math.inf,
    choices: tuple = (),
):
    """Return a dataclass field that is an option.

    Parameters
    ----------
    default : bool, int, float or str
        Its type is the option's.
    text : str
        What it is, with the unit.
    key : str
        Name, if it is not the field's: with slashes.
    minimum, maximum : float
        Of a number.
    choices : tuple of str
        Of a string.
    """
    metadata = {"text": text, "key": key, "limits": (minimum, maximum), "choices": choices}
    return dataclasses.field(default=default, metadata=metadata)


def key_of(field) -> str:
    """Return the name of a field's option."""
    return field.metadata["key"] or field.name


def parse_arguments(options_class: type, arguments, program: str, description: str):
    """Return the options on a command line.

    Exits with status 2 and a message when there is something wrong with them.

    Parameters
    ----------
    options_class : type
    arguments : list of str
        Without the program's name.
    program, description : str
        For ``--help``.
    """
    parser = argparse.ArgumentParser(
        prog=program,
        description=description,
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    for field in dataclasses.fields(options_class):
        parser.add_argument(
            "--" + key_of(field).replace("/", "-").replace("_", "-"),
            dest=field.name,
            default=field.default,
            type=_reader(field),
            metavar=type(field.default).__name__.upper(),
            help=field.metadata["text"],
        )
    return options_class(**vars(parser.parse_args(arguments)))


def _reader(field):
    low, high = field.metadata["limits"]
    choices = field.metadata["choices"]
    kind = type(field.default)

    def read(text):
        if kind is bool:
            if text.lower() not in ("true", "false"):
                raise argparse.ArgumentTypeError(f"{text!r}: expected true or false")
            return text.lower() == "true"
        if kind is str:
            if choices and text not in choices:
                expected = ", ".join(choices)
                raise argparse.ArgumentTypeError(f"{text!r}: expected one of {expected}")
            return text
        try:
            value = int(text, 0) if kind is int else float(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r}: expected a number") from None
        if not (math.isfinite(value) and low <= value <= high):
            raise argparse.ArgumentTypeError(f"{text}: expected {low:g} to {high:g}")
        return value

    return read
