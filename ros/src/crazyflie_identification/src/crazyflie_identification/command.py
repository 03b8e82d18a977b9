"""The command identify: a bag in, the model of its vehicle out."""

import argparse
import sys
from pathlib import Path

from crazyflie_identification import fit, page, recording, residual
from crazyflie_identification.fit import NAMES, IdentificationError
from crazyflie_model.quadrotor import TYPES
from crazyflie_reports.bag_file import BagError
from crazyflie_utils.parameters import model_file
from crazyflie_utils.text_file import user_path

_DESCRIPTION = """
Find the model of a vehicle in the bag of a flight: mass, thrust curve, delay, lags of roll, pitch
and yaw, drag and trims, with standard errors, and a page that compares it with a part of the flight
that was not used. excite:=true of hw_hover.launch flies what tells all of them.
"""


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit status: 0, or 1 with the reason on stderr."""
    options = _parser().parse_args(arguments)
    try:
        _identify(options.bag, options.type, options.vehicle, options.out)
    except (BagError, IdentificationError, OSError) as error:
        print(f"identify: {error}", file=sys.stderr)
        return 1
    return 0


def _identify(bag: Path, kind: str, vehicle: str, out: Path) -> None:
    model = TYPES[kind]
    flight = recording.of_bag(bag, model, vehicle)
    try:
        found = fit.identify(flight, model)
    except IdentificationError as error:
        raise IdentificationError(f"{bag}: {error}") from None
    print(*found.lines(), sep="\n")
    errors = dict(zip(NAMES, map(float, found.errors), strict=True))
    limits = residual.bounds(found)
    disturbance = limits["disturbance"]
    print(
        f"disturbance (99.9 % of {limits['seconds']:g} s): {disturbance['horizontal']:.2f} m/s^2 "
        f"along x and y, {disturbance['vertical']:.2f} m/s^2 along z"
    )
    result = {"bag": str(bag), "standard_errors": errors, "bounds": limits}
    model_file.save(out, kind, found.model, result)
    shown = out.with_suffix(".html")
    shown.write_text(page.page(found, model, f"{bag.name}: {kind}"), encoding="utf-8")
    print(f"model: {out}", f"page: {shown}", f"fly it: model:={out.resolve()}", sep="\n")


def _parser():
    parser = argparse.ArgumentParser(prog="identify", description=_DESCRIPTION)
    parser.add_argument(
        "bag", type=user_path, metavar="BAG", help="a bag, or the folder of a recording"
    )
    parser.add_argument(
        "--type",
        choices=sorted(TYPES),
        default="cf21",
        help="type of the vehicle, whose thrust curve gives the mass (%(default)s)",
    )
    parser.add_argument("--vehicle", default="", help="name of the vehicle, if the bag has several")
    parser.add_argument(
        "--out", type=user_path, default=Path("model.yaml"), help="model file (%(default)s)"
    )
    return parser
