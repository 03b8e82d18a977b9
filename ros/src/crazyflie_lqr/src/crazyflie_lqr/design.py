"""Linear-quadratic gains: weights in, gains out, with the sign of u = u_ref + K e.

The cost is the integral (of a sampled design the sum) of
x^T Q x + u^T R u + 2 x^T N u over the deviations from hover.
"""

import math
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete

from crazyflie_lqr.models import LinearModel

_ROUNDOFF = 1e-9  #: Ratio to the neighbouring entries below which an entry is set to zero.
_MAX_DELAY_STEPS = 50  #: Longest delay, in sample times; each adds u_dim states.


class DesignError(ValueError):
    """No gains can be designed; the text says why."""


@dataclass(frozen=True)
class Weights:
    """Weights of deviations and controls in the cost."""

    #: Weights of the state, shape (x_dim, x_dim), symmetric, positive semidefinite.
    Q: NDArray[np.float64]
    #: Weights of the control, shape (u_dim, u_dim), symmetric, positive definite.
    R: NDArray[np.float64]
    #: Weights of the products of state and control, shape (x_dim, u_dim); ``[[Q, N], [N^T, R]]`` is
    #: positive semidefinite.
    N: NDArray[np.float64]

    def check(self) -> None:
        """Raise `DesignError` unless the weights make a cost that has a minimum."""
        for name, matrix in (("Q", self.Q), ("R", self.R), ("N", self.N)):
            if not np.isfinite(matrix).all():
                raise DesignError(f"{name} has entries that are not finite")
        for name, matrix in (("Q", self.Q), ("R", self.R)):
            if not np.allclose(matrix, matrix.T, rtol=_ROUNDOFF, atol=0.0):
                i, j = np.argwhere(~np.isclose(matrix, matrix.T, rtol=_ROUNDOFF, atol=0.0))[0]
                raise DesignError(
                    f"{name} is not symmetric: entry ({i + 1}, {j + 1}) is {matrix[i, j]:g}, "
                    f"({j + 1}, {i + 1}) is {matrix[j, i]:g}"
                )
        least = np.linalg.eigvalsh(self.R)[0]
        if least <= _ROUNDOFF * np.abs(self.R).max():
            raise DesignError(
                f"R is not positive definite (least eigenvalue {least:.3g}); every control "
                "must cost something"
            )
        least = np.linalg.eigvalsh(self.Q)[0]
        if least < -_ROUNDOFF * np.abs(self.Q).max():
            raise DesignError(
                f"Q is not positive semidefinite (least eigenvalue {least:.3g}); no deviation "
                "may be rewarded"
            )
        joint = np.block([[self.Q, self.N], [self.N.T, self.R]])
        least = np.linalg.eigvalsh(joint)[0]
        if least < -_ROUNDOFF * np.abs(joint).max():
            raise DesignError(
                f"N is too large: [[Q, N], [N^T, R]] has the eigenvalue {least:.3g}, and the "
                "cost has no minimum"
            )


@dataclass(frozen=True)
class Design:
    """Gains and the plant they were designed for."""

    K: NDArray[np.float64]  #: Shape (u_dim, x_dim). Gains, u = u_ref + K (x - x_ref).
    #: Shape (n, n). Dynamics of the plant: the model's; in a sampled design, one step of the model
    #: and, behind the x_dim states of the model, the controls that are still on their way.
    A: NDArray[np.float64]
    B: NDArray[np.float64]  #: Shape (n, u_dim).
    sample_time: float  #: Sample time (s); 0 is continuous.

    @property
    def feedback(self) -> NDArray[np.float64]:
        """Gains on all states of the plant, shape (u_dim, n); zero on delayed controls."""
        missing = self.A.shape[0] - self.K.shape[1]
        return np.pad(self.K, ((0, 0), (0, missing)))

    @property
    def poles(self) -> NDArray[np.float64]:
        """Poles of the closed loop, shape (n,), rad/s; of a sampled one log(z) / sample_time.

        A pole near z = 0, gone after some samples, is at minus infinity.
        """
        poles = np.linalg.eigvals(self.A + self.B @ self.feedback).astype(complex)
        if self.sample_time == 0.0:
            return poles
        gone = np.abs(poles) < 1e-3
        return np.where(gone, -math.inf, np.log(np.where(gone, 1.0, poles)) / self.sample_time)


def design_gains(
    model: LinearModel, weights: Weights, sample_time: float = 0.0, delay: float = 0.0
) -> Design:
    """Return the gains of least cost; `DesignError` without a solution, or for invalid inputs.

    Parameters
    ----------
    model : LinearModel
    weights : Weights
    sample_time : float
        Time between two controls, s, each held until the next; 0 designs in continuous time.
    delay : float
        Time from the measurement of a state until its control acts, s.

    Notes
    -----
    With a delay the optimal control also feeds back the controls that are on
    their way, ``u = K_x x + K_u (u[-1] + ... )``, which a gain file cannot hold.
    The gains returned are those for controls that change little within the
    delay, ``u = (1 - sum K_u)^-1 K_x x``. They are within some percent of the
    cost of the best gains on the state alone.
    """
    weights.check()
    for name, value in (("sample time", sample_time), ("delay", delay)):
        if not 0.0 <= value < math.inf:
            raise DesignError(f"the {name} is {value:g} s; expected a number >= 0")
    if delay > 0.0 and sample_time == 0.0:
        raise DesignError("a delay needs a sample time")
    if delay > _MAX_DELAY_STEPS * sample_time:
        raise DesignError(
            f"the delay of {delay:g} s is longer than {_MAX_DELAY_STEPS} sample times"
        )
    _check_solvable(model, weights)
    if sample_time == 0.0:
        K = -_solve(control.lqr, model.A, model.B, weights)
        design = Design(_clean(K), model.A, model.B, 0.0)
    else:
        A, B = sampled(model, sample_time, delay)
        K = -_solve(control.dlqr, A, B, _padded(weights, A.shape[0]))
        x_dim, u_dim = model.x_dim, model.u_dim
        on_their_way = K[:, x_dim:].reshape(u_dim, -1, u_dim).sum(axis=1)
        K = np.linalg.solve(np.eye(u_dim) - on_their_way, K[:, :x_dim])
        design = Design(_clean(K), A, B, sample_time)
    if design.poles.real.max() >= 0.0:
        raise DesignError(
            f"the closed loop has a pole at {design.poles.real.max():.3g} rad/s: these weights "
            f"ask for more than the delay of {delay:g} s allows; raise R or lower Q"
        )
    return design


def sampled(
    model: LinearModel, sample_time: float, delay: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return A and B of one step of a model whose control is held and comes late.

    The delay may be any multiple or fraction of the sample time, s. A has the shape (n, n), B (n,
    u_dim), with n = x_dim + d u_dim and d = ceil(delay / sample_time): the state and the last d
    controls, latest first. Exact; see Astrom and Wittenmark, Computer-Controlled Systems, section
    2.3.
    """
    x_dim, u_dim = model.x_dim, model.u_dim
    steps = math.ceil(delay / sample_time - _ROUNDOFF)
    A_step, B_step = _held(model, sample_time)
    if steps == 0:
        return A_step, B_step
    old = delay - (steps - 1) * sample_time
    A_new, B_new = _held(model, sample_time - old)
    _, B_old = _held(model, old)
    inputs = [np.zeros_like(B_step) for _ in range(steps + 1)]
    inputs[steps] = A_new @ B_old
    inputs[steps - 1] = B_new
    A = np.zeros((x_dim + steps * u_dim,) * 2)
    A[:x_dim] = np.hstack([A_step, *inputs[1:]])
    A[x_dim + u_dim :, x_dim:-u_dim] = np.eye((steps - 1) * u_dim)
    B = np.vstack([inputs[0], np.eye(u_dim), np.zeros(((steps - 1) * u_dim, u_dim))])
    return A, B


def _held(model, duration):
    # A and B stand for the outputs, too, which are not used.
    return cont2discrete((model.A, model.B, model.A, model.B), duration)[:2]


def _padded(weights, n):
    more = n - weights.Q.shape[0]
    return Weights(np.pad(weights.Q, (0, more)), weights.R, np.pad(weights.N, ((0, more), (0, 0))))


def _check_solvable(model, weights):
    """Raise `DesignError` for modes that are not stabilisable, or not detectable by the weights.

    The test is Hautus's, for every mode that does not decay by itself.
    """
    unweighted = weights.Q - weights.N @ np.linalg.solve(weights.R, weights.N.T)
    A_cost = model.A - model.B @ np.linalg.solve(weights.R, weights.N.T)
    for pole in np.linalg.eigvals(model.A):
        if pole.real >= -_ROUNDOFF:
            mode = _unreached(model.A.T, model.B.T, pole)
            if mode is not None:
                raise DesignError(
                    f"{model.name} is not stabilisable: no control reaches "
                    f"{_name(model, mode)} (mode at {pole:.3g} rad/s)"
                )
    for pole in np.linalg.eigvals(A_cost):
        if abs(pole.real) <= _ROUNDOFF:
            mode = _unreached(A_cost, unweighted, pole)
            if mode is not None:
                raise DesignError(
                    f"the weights do not see {_name(model, mode)}, which does not decay by "
                    f"itself (mode at {pole:.3g} rad/s): raise its entry in Q"
                )


def _unreached(A, C, pole):
    """Return v with A v = pole v and C v = 0, or None."""
    pencil = np.vstack([A - pole * np.eye(A.shape[0]), C])
    _, values, modes = np.linalg.svd(pencil)
    return modes[-1].conj() if values[-1] <= _ROUNDOFF * values[0] else None


def _name(model, mode):
    size = np.abs(mode)
    return ", ".join(s for s, v in zip(model.states, size, strict=True) if v > 0.1 * size.max())


def _solve(solver, A, B, weights):
    try:
        return np.asarray(solver(A, B, weights.Q, weights.R, weights.N)[0])
    except (np.linalg.LinAlgError, ValueError) as error:
        raise DesignError(f"the Riccati equation has no stabilising solution: {error}") from None


def _clean(K):
    return np.where(np.abs(K) < _ROUNDOFF * np.abs(K).max(), 0.0, K)
