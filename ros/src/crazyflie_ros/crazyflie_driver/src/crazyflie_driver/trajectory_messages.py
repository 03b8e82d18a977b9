"""Pieces of uploaded trajectories as the services have them."""

import genpy

from crazyflie_driver.msg import TrajectoryPolynomialPiece
from crazyflie_model.polynomials import PolynomialPiece


def to_message(piece: PolynomialPiece) -> TrajectoryPolynomialPiece:
    """Return a piece for the service upload_trajectory."""
    return TrajectoryPolynomialPiece(*piece.padded_axes, genpy.Duration.from_sec(piece.duration))


def from_message(message: TrajectoryPolynomialPiece) -> PolynomialPiece:
    """Return an uploaded piece."""
    axes = (message.poly_x, message.poly_y, message.poly_z, message.poly_yaw)
    return PolynomialPiece(message.duration.to_sec(), *axes)
