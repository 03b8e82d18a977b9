"""The command design_gains: weights in, gain file out."""

import argparse
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from crazyflie_lqr.design import Design, DesignError, Weights, design_gains
from crazyflie_lqr.gain_file import save_matrix
from crazyflie_lqr.margins import FLOWN_PERIOD, Margins, all_margins, flown
from crazyflie_lqr.models import CONTROLS, MODELS, LinearModel
from crazyflie_utils.text import number_from_text

_DESCRIPTION = """
Design the gains K of u = u_ref + K (x - x_ref) that cost least, where the cost is the
integral of x'Qx + u'Ru + 2x'Nu; print closed-loop poles and margins, and those of the loop as
it is flown.
"""

LEAST_DELAY = 0.02  #: Least delay margin of gains as flown (s); below it, ``--force`` is needed.

_MATRIX_HELP = """
numbers, separated by blanks or commas: the diagonal, or the matrix row by row; or the path
of a text file with them
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit status: 0, or 1 if the design fails."""
    options = _parser().parse_args(arguments)
    model = MODELS[options.model]()
    try:
        x_dim, u_dim = model.x_dim, model.u_dim
        Q, R = _matrix("Q", options.Q, x_dim, x_dim), _matrix("R", options.R, u_dim, u_dim)
        N = np.zeros((x_dim, u_dim))
        if options.N is not None:
            N = _matrix("N", options.N, x_dim, u_dim)
        weights = Weights(Q, R, N)
        design = design_gains(model, weights, options.sample_time, options.delay)
        print(report(model, design))
        loops = _flown_margins(options, model, design)
        print(flown_report(loops, options))
        least = min(margins.delay for margins in loops)
        if least < LEAST_DELAY and not options.force:
            raise DesignError(
                f"flown, these gains tolerate {1e3 * least:.1f} ms of delay; expected at least "
                f"{1e3 * LEAST_DELAY:g} ms: raise R or lower Q, or add --force"
            )
        if options.out:
            save_matrix(options.out, design.K, _comment(model, weights, options))
            print(f"wrote {options.out}")
        if options.plot:
            from crazyflie_lqr.design_plot import save_plot

            save_plot(options.plot, model, design)
            print(f"wrote {options.plot}")
    except (OSError, ValueError) as error:
        print(f"design_gains: {error}", file=sys.stderr)
        return 1
    return 0


def report(model: LinearModel, design: Design) -> str:
    """Return gains, poles and margins of a design as text."""
    lines = [f"{model.name}, {_time(design)}"]
    lines += [" " * 8 + "".join(f"{state:>10}" for state in model.states)]
    lines += [
        f"{control:8}" + "".join(f"{value:10.4g}" for value in row)
        for control, row in zip(CONTROLS, design.K, strict=True)
    ]
    lines += ["poles (rad/s): " + _poles(design)]
    lines += ["loop      gain may grow, shrink (dB)   phase margin (deg)   at (rad/s)   delay (ms)"]
    for control, margins in zip(CONTROLS, all_margins(design), strict=True):
        lines.append(
            f"{control:8}{_decibels(margins.gain_up):>15}{_decibels(margins.gain_down):>14}"
            f"{_number(math.degrees(margins.phase)):>21}{_number(margins.crossover):>13}"
            f"{_number(1e3 * margins.delay):>13}"
        )
    return "\n".join(lines)


def flown_report(loops: Sequence[Margins], options: argparse.Namespace) -> str:
    """Return the margins of the loops as they are flown as text."""
    plant, period = options.plant or options.model, options.sample_time or FLOWN_PERIOD
    lines = [f"flown with {plant}, a control every {1e3 * period:g} ms:"]
    lines += ["loop      delay (ms)   modulus margin"]
    lines += [
        f"{control:8}{_number(1e3 * margins.delay):>12}{margins.modulus:>17.2f}"
        for control, margins in zip(CONTROLS, loops, strict=True)
    ]
    return "\n".join(lines)


def _flown_margins(options, model, design):
    plant, period = MODELS[options.plant or options.model](), options.sample_time or FLOWN_PERIOD
    missing = [name for name in model.states if name not in plant.states]
    if missing:
        raise DesignError(f"{plant.name} has no {', '.join(missing)}; expected a --plant that has")
    return all_margins(flown(design.K, model.states, plant, period, options.delay))


def _parser():
    parser = argparse.ArgumentParser(prog="design_gains", description=_DESCRIPTION)
    parser.add_argument("--model", choices=sorted(MODELS), required=True)
    parser.add_argument("--Q", nargs="+", required=True, help=f"state weights: {_MATRIX_HELP}")
    parser.add_argument("--R", nargs="+", required=True, help=f"control weights: {_MATRIX_HELP}")
    parser.add_argument("--N", nargs="+", help="cross weights, row by row (default: none)")
    parser.add_argument(
        "--sample_time",
        type=float,
        default=0.0,
        help="time for which a control is held, s (default 0: continuous time)",
    )
    parser.add_argument(
        "--delay",
        type=float,
        default=0.0,
        help="time from the measurement of a state until its control acts, s; needs --sample_time",
    )
    parser.add_argument(
        "--plant",
        choices=sorted(MODELS),
        help="plant that is flown, for the margins (default: the model); full_state has an "
        "attitude lag",
    )
    parser.add_argument(
        "--force",
        action="store_true",
        help=f"accept gains that tolerate less than {1e3 * LEAST_DELAY:g} ms of delay",
    )
    parser.add_argument("--out", metavar="FILE", help="write the gains to a file")
    parser.add_argument("--plot", metavar="FILE", help="draw step responses and Bode diagrams")
    # A list of numbers that looks like an option is a list of numbers.
    parser._negative_number_matcher = _NumberList()  # type: ignore[assignment]
    return parser


class _NumberList:
    """Replaces argparse's pattern of negative numbers, which does not match lists."""

    def match(self, text):
        try:
            _numbers(text)
        except ValueError:
            return False
        return True


def _matrix(name, words, rows, columns):
    text = " ".join(words)
    # Unlike pathlib's, this takes a text that is too long for a name.
    if len(words) == 1 and os.path.isfile(text):
        lines = Path(text).read_text(encoding="utf-8", errors="replace").splitlines()
        text = " ".join(line.partition("#")[0] for line in lines)
    try:
        values = _numbers(text)
    except ValueError as error:
        raise DesignError(f"{name}: {error}, and not the name of a file") from None
    if len(values) == rows * columns:
        return np.reshape(values, (rows, columns))
    if rows == columns == len(values):
        return np.diag(values)
    diagonal = f"{rows} (the diagonal) or " if rows == columns else ""
    raise DesignError(
        f"{name} has {len(values)} numbers; expected {diagonal}{rows * columns} "
        f"({rows} rows of {columns})"
    )


def _numbers(text):
    return [number_from_text(word) for word in text.replace(",", " ").split()]


def _comment(model, weights, options):
    command = f"design_gains --model {model.name} --Q {_words(weights.Q)} --R {_words(weights.R)}"
    if weights.N.any():
        command += f" --N {_words(weights.N)}"
    for name in ("sample_time", "delay"):
        if getattr(options, name):
            command += f" --{name} {getattr(options, name):g}"
    if options.plant:
        command += f" --plant {options.plant}"
    if options.force:
        command += " --force"
    return (
        "Gains K of u = u_ref + K (x - x_ref), SI units and rad.\n"
        f"Rows: {', '.join(CONTROLS)}. Columns: {', '.join(model.states)}.\n"
        f"{command}"
    )


def _words(matrix):
    rows, columns = matrix.shape
    if rows == columns and not np.any(matrix - np.diag(np.diag(matrix))):
        matrix = np.diag(matrix)
    return " ".join(f"{value:.15g}" for value in np.ravel(matrix))


def _time(design):
    if design.sample_time == 0.0:
        return "continuous time"
    steps = (design.A.shape[0] - design.K.shape[1]) // design.K.shape[0]
    text = f"sampled every {1e3 * design.sample_time:g} ms"
    return text + (f", {steps} controls on their way" if steps else "")


def _poles(design):
    texts: dict[str, int] = {}
    for pole in sorted(design.poles, key=lambda p: -p.real):
        if pole.imag >= -1e-6 * abs(pole):
            text = f"{pole.real:.4g}"
            if pole.imag > 1e-6 * abs(pole):
                text += f" +- {pole.imag:.4g}j"
            texts[text] = texts.get(text, 0) + 1
    return ", ".join(text + (f" (x{n})" if n > 1 else "") for text, n in texts.items())


def _decibels(factor):
    return _number(20.0 * math.log10(factor)) if factor > 0.0 else "-inf"


def _number(value):
    return "-" if math.isnan(value) else f"{value:.3g}"
