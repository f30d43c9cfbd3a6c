"""Error to expect of a planned session, in parts: noise, gains, friction beyond the columns, delay.

An identification fits rows A of the unknowns and columns K of friction to τ + e + M z. The noise e
has the standard deviation σ, z are errors of the model that nothing estimates, z_k ~ N(0, s_k²):

    C = (AᵀPA + κB)⁻¹,   P = W^½ (1 − K̃ K̃⁺) W^½,   errors = C^½ and C AᵀP M diag(s)

The mean square of any linear function of the unknowns is the sum of squares over both matrices.
Unknowns are the inertial parameters of the arm with the URDF as prior, or the ten of a payload
from an empty and a loaded run of the same session.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from runtime.estimators.convex.entropic_prior import spread_of
from runtime.estimators.regression.posterior import orthonormal, posterior_of
from runtime.excitation.motion.trajectory import JoinedMotion, Trajectory
from runtime.excitation.search.criteria import PAYLOAD
from runtime.excitation.search.information import Information
from runtime.identification.expected_accuracy.expected import Knowledge, with_earlier
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording import Friction
from runtime.recording.friction.columns import OFFSET
from runtime.recording.friction.coupled_motors import spread
from runtime.recording.friction.model import columns
from runtime.recording.settings import JointMotion

MOST_ROWS = 1500
"""Largest number of instants that stand for a session."""
SLOW = 0.05
"""Share of the velocity limit below which friction rises (Stribeck)."""
NOISE, GAINS, FRICTION, DELAY = (
    "noise, friction columns and offsets",
    "gains of the torque sensors",
    "friction beyond the columns",
    "delay of the torque",
)
"""Parts of the error."""


@dataclass(frozen=True, slots=True)
class ModelError:
    """Standard deviations of errors of the model that an identification does not estimate."""

    gain: float = 0.005  # of every torque gain, relative to one
    # of friction that the columns miss, in each direction a share of the effort limit: a rise at
    # low speed, a cubic in the speed, and for a payload the change of Coulomb and viscous friction
    # between the runs
    friction: float = 0.001
    load: float = 0.01  # of the growth of friction with the torque in each direction, a share of it
    delay_s: float = 0.0005  # of the torque [s]


@dataclass(frozen=True, slots=True)
class ErrorParts:
    """Errors of the unknowns by part."""

    # name of the part → matrix R of (10 n or 10, m), R Rᵀ its mean square
    roots: Mapping[str, Array]
    gains: Array  # (n,) standard deviations of the gains, the columns of the part `GAINS`

    def parts(self, size: Callable[[str, Array], float]) -> dict[str, float]:
        """Size of every part."""
        return {name: size(name, root) for name, root in self.roots.items()}

    def total(self, size: Callable[[str, Array], float]) -> float:
        """Root of the sum of squares of all parts."""
        return float(np.linalg.norm(list(self.parts(size).values())))


def error_parts_of(
    lib: Library,
    session: Trajectory | JoinedMotion,
    known: Information,
    error: ModelError,
    payload: bool = False,
) -> ErrorParts:
    """Expected errors of an identification from the log of a session, by part."""
    count = int(np.clip(known.rate * session.duration, 50, MOST_ROWS))
    t = np.linspace(0.0, session.duration, count)
    q, dq, ddq, _ = session.at(lib, t)
    rows = lib.regressor(q, dq, ddq)
    missed = _missed(lib, t, dq, rows, error, payload)
    names, noise = known.friction, known.noise
    if payload:
        # Friction and the arm cancel between the runs; noise adds up, offsets drift.
        rows, names, noise = rows[:, :, -N_PARAMETERS:], (OFFSET.name,), np.sqrt(2.0) * noise
    weight = np.sqrt(known.rate * session.duration / count) / noise[:, None]
    scaled = [part * weight for part in (rows, *missed.values())]
    nuisance = spread(columns(JointMotion(dq), Friction(names)), None) * weight
    # Rows without their part along the friction columns.
    flat = [part.reshape(-1, part.shape[2]) for part in (nuisance, *scaled)]
    basis = orthonormal(flat[0])
    a, *rest = [part - basis @ (basis.T @ part) for part in flat[1:]]
    # Very large where the ten parameters of a payload are not determined.
    if payload:
        root = posterior_of(a, is_wide=True).root
    else:  # with the URDF as prior
        arm = Knowledge.of(lib)
        counted = with_earlier(a, known.earlier, lib)
        root = spread_of(arm.prior.bodies, arm.pi, counted, arm.kappa).root
    gain = root @ (root.T @ a.T)
    errors = {name: gain @ part for name, part in zip(missed, rest, strict=True)}
    return ErrorParts({NOISE: root, **errors}, np.full(lib.n_joints, error.gain))


def _missed(
    lib: Library, t: Array, dq: Array, rows: Array, error: ModelError, payload: bool
) -> dict[str, Array]:
    """Columns M diag(s) by part, (N, n, k) each."""
    limits = lib.limits()
    tau = rows[:, :, -N_PARAMETERS:] @ PAYLOAD if payload else rows @ lib.pi0
    rate = np.gradient(tau, t, axis=0)
    effort = np.where(np.isfinite(limits["effort"]), limits["effort"], np.abs(tau).max(axis=0))
    fast = np.where(np.isfinite(limits["velocity"]), limits["velocity"], np.abs(dq).max(axis=0))
    share, level = dq / np.maximum(fast, np.finfo(float).tiny), error.friction * effort
    sign = np.tanh(share / (0.1 * SLOW))
    shapes = [level * sign * np.exp(-np.abs(share) / SLOW), level * share**3]
    if payload:
        shapes = [level * sign, level * share]
    shapes.append(error.load * np.abs(tau) * sign)
    # Both directions have their own coefficients: a motion out and back does not cancel them.
    both = [one * side for one in shapes for side in (dq > 0, dq < 0)]
    return {
        GAINS: spread((error.gain * tau)[:, :, None], None),
        FRICTION: np.concatenate([spread(one[:, :, None], None) for one in both], axis=2),
        DELAY: spread((error.delay_s * rate)[:, :, None], None),
    }
