"""Base parameters: the identifiable combinations β = K π, τ = Y π = Y_b β.

`numeric_base` samples the regressor and decides its rank by a gap in the singular values.
`regrouped` moves entries of π towards the base on symbols, for trees and any placement of joints:
the part of a body that its joint does not move relative to the link before acts as if it were fixed
to that link. Kernels of torque and mass take the result: a seventh to a fifth fewer operations, and
the same τ.
Source: document Sec. 3.2; Gautier & Khalil, IEEE T-RA 6(3), 1990.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from symgen.chain import Chain, Joint
from symgen.chain.model import FLOATING
from symgen.errors import RankError
from symgen.kernel import Array, Matrix
from symgen.mechanics.inertia import (
    N_PARAMETERS,
    PI_NAMES,
    MassMoments,
    bodies_of,
    in_parent_frame,
    pi_of_body,
    sum_of_bodies,
)

SILENT_COLUMN = 1e-11
"""Norm of a column of W over the largest, below which it is rounding error and counts as zero."""
CLEAR_GAP = 1e3  # least ratio of neighbouring singular values that marks the rank
ROUNDING = 1e-13  # singular value, relative to the largest, below which only rounding error is left
_SAMPLES_PER_COLUMN = 4  # random states per column of Y
_LARGE = 12  # links above which W has `_FEW` states, or `_SAMPLES_PER_COLUMN` rows per column
_FEW = 120  # states of a large robot: ten rows per parameter of a link that acts on one joint only
_SNAP_DIGITS = 12  # decimals to which an entry of K is rounded
_SNAP_WITHIN = 2e-14  # relative distance within which an entry of K is replaced by the rounded one


@dataclass(frozen=True, slots=True)
class BaseParameters:
    """β = K π and the evidence of the rank decision."""

    columns: tuple[int, ...]  # indices into π of the independent columns; Y_b = Y[:, columns]
    matrix: Array  # (n_b, 10 L) K, identity on `columns`
    smallest_kept: float  # last singular value inside the row space, relative to the largest
    largest_dropped: float  # first singular value outside, relative to the largest

    @property
    def lossless(self) -> bool:
        """True if the dropped directions are rounding error: Y_b β is Y π to the last digits."""
        return self.largest_dropped < ROUNDING

    @property
    def gap(self) -> float:
        """Ratio of the last kept to the first dropped singular value."""
        return self.smallest_kept / self.largest_dropped


def numeric_base(
    chain: Chain, regressor: Callable[[Array, Array, Array], Array], seed: int = 0
) -> BaseParameters:
    """Rank and regrouping from a sampled regressor W = [Y_1; Y_2; …].

    W's columns are normalised, the rank is the first place where neighbouring singular values
    differ by more than `CLEAR_GAP`, the independent columns are picked greedily in the order
    that the regrouping rules prefer, and K solves W_b K = W.
    """
    n, links = chain.freedom, len(chain.joints)
    rng = np.random.default_rng(seed)
    samples = _SAMPLES_PER_COLUMN * N_PARAMETERS * links
    if links > _LARGE:  # n rows per state: a few states suffice, and W stays small
        samples = max(_FEW, -(-samples // n))
    # Turns and travels of order one: revolute states in rad, prismatic ones in m.
    q = rng.uniform(-np.pi, np.pi, (samples, n))
    dq, ddq = rng.normal(0, 2, (2, samples, n))
    # Columns of unit length: parameters of different units and sizes become comparable.
    if chain.loops is None:
        w = regressor(q, dq, ddq).reshape(-1, N_PARAMETERS * links)
    else:
        w = _closed_rows(chain, regressor, q, dq, ddq)
    norms = np.linalg.norm(w, axis=0)
    nonzero = np.flatnonzero(norms > SILENT_COLUMN * norms.max())
    unit = w[:, nonzero] / norms[nonzero]
    # The rank is where σ_k / σ_{k+1} first exceeds CLEAR_GAP; ε is appended for a full-rank W.
    sigma = np.linalg.svd(unit, compute_uv=False)
    sigma = np.append(sigma / sigma[0], np.finfo(float).eps)
    falls = np.flatnonzero(sigma[:-1] > CLEAR_GAP * sigma[1:])
    if falls.size == 0:
        raise RankError(
            f"expected a gap of {CLEAR_GAP:g} between neighbouring singular values of the "
            f"regressor, they decrease without one (smallest {sigma[-2]:.1e}), so the number of "
            "base parameters is undecided; if the URDF rounds its angles, use --settings snap=1e-4"
        )
    rank = int(falls[0]) + 1
    # Independent columns in the order of the regrouping rules, then W_b K = W by least squares.
    order = sorted(range(len(nonzero)), key=lambda k: _preference(chain, int(nonzero[k])))
    columns = tuple(sorted(int(nonzero[k]) for k in _independent(unit, order, rank)))
    k_nonzero = np.linalg.lstsq(w[:, columns], w[:, nonzero], rcond=None)[0]
    matrix = np.zeros((rank, N_PARAMETERS * links))
    matrix[:, nonzero] = _tidied(np.asarray(k_nonzero, dtype=float))
    matrix[:, columns] = np.eye(rank)
    return BaseParameters(columns, matrix, float(sigma[rank - 1]), float(sigma[rank]))


def _closed_rows(
    chain: Chain, regressor: Callable[[Array, Array, Array], Array], q: Array, dq: Array, ddq: Array
) -> Array:
    """W of a closed chain: all around the assembly pose where its loops close, and in its range.

    A narrow range makes columns nearly dependent. The rows of a state are divided by their largest
    entry, since they grow without bound towards a singular posture.
    """
    assembly = [chain.loops.assembly[k] for k in chain.loops.independent] if chain.loops else []
    inside = q / np.pi
    ends = [
        (-np.pi, np.pi) if j.lower is None or j.upper is None else (j.lower, j.upper)
        for j in chain.coordinates
    ]
    lower, upper = np.array(ends).T
    states = np.vstack([assembly + q, (lower + upper) / 2 + (upper - lower) * inside / 2])
    y = regressor(states, np.vstack([dq, dq]), np.vstack([ddq, ddq]))
    y = y[np.isfinite(y).all(axis=(1, 2))]
    y = y / np.maximum(np.abs(y).max(axis=(1, 2), keepdims=True), np.finfo(float).tiny)
    return np.asarray(y.reshape(-1, y.shape[2]))


def _preference(chain: Chain, column: int) -> tuple[int, int]:
    """Sort key of a column: those that the regrouping rules keep come first.

    About a joint axis z, Table 3.2 moves m, mZ and YY into the parent; x and y follow cyclically.
    """
    link, parameter = divmod(column, N_PARAMETERS)
    if chain.joints[link].kind == FLOATING:  # all ten are independent
        return (False, column)
    axis = int(np.argmax(np.abs(chain.joints[link].axis)))
    moved = {"m", ("mX", "mY", "mZ")[axis], ("ZZ", "XX", "YY")[axis]}
    return (PI_NAMES[parameter] in moved, column)


def _independent(unit: Array, order: list[int], rank: int) -> list[int]:
    """First `rank` columns in the given order outside the span of their predecessors."""
    vectors = np.empty((unit.shape[0], rank), order="F")
    basis = vectors[:, :0]
    chosen: list[int] = []
    for k in order:
        v = unit[:, k]
        for _ in range(2):  # twice is enough for orthogonality to rounding
            v = v - basis @ (basis.T @ v)
        length = float(np.linalg.norm(v))
        if length > 1.0 / CLEAR_GAP**1.5 and basis.shape[1] < rank:
            vectors[:, basis.shape[1]] = v / length
            basis = vectors[:, : basis.shape[1] + 1]
            chosen.append(k)
    while len(chosen) < rank:  # nearly dependent columns: the farthest from the span so far
        rest = unit - basis @ (basis.T @ unit)
        rest = rest - basis @ (basis.T @ rest)
        lengths = np.linalg.norm(rest, axis=0)
        lengths[chosen] = 0.0
        k = int(np.argmax(lengths))
        if not lengths[k] > ROUNDING * CLEAR_GAP:
            break
        vectors[:, basis.shape[1]] = rest[:, k] / lengths[k]
        basis = vectors[:, : basis.shape[1] + 1]
        chosen.append(k)
    if len(chosen) < rank:
        raise RankError(
            f"expected {rank} independent columns by the singular values, got {len(chosen)}; "
            "if the URDF rounds its angles, use --settings snap=1e-4"
        )
    return chosen


def _tidied(matrix: Array) -> Array:
    """K without rounding in zeros and short decimals, so that it is the same on all machines."""
    rounded = np.round(matrix, _SNAP_DIGITS) + 0.0
    close = np.abs(matrix - rounded) < _SNAP_WITHIN * np.maximum(1.0, np.abs(matrix))
    return np.where(close, rounded, matrix)


def regrouped(chain: Chain, pi: Matrix) -> Matrix:
    """Return a π' with Y π' = Y π, both (10 L,), whose entries are mostly structural zeros."""
    bodies = bodies_of(pi)
    # From the tip inwards, so that a body holds what its children gave before it is split.
    for i, joint in reversed(list(enumerate(chain.joints))):
        bodies[i], moved = _split(joint, bodies[i])
        # Moved at q = 0: the moved part is invariant under the joint's motion, so any q would do.
        if joint.parent >= 0:  # what is moved to the base acts on no joint and is dropped
            rotation, translation = ca.SX(ca.DM(joint.rotation)), ca.DM(joint.translation)
            more = in_parent_frame(ca.sparsify(rotation), translation, moved)
            bodies[joint.parent] = sum_of_bodies(bodies[joint.parent], more)
    return ca.vertcat(*(pi_of_body(*body) for body in bodies))


def _split(joint: Joint, body: MassMoments) -> tuple[MassMoments, MassMoments]:
    """Split a body into the part that its joint moves and the part that acts as if it were fixed.

    A prismatic joint does not rotate: all of I is moved. About an axis z the mass, mZ, and YY as
    the body diag(YY, YY, 0) are moved, since every rotation about z maps that body to itself; x and
    y follow cyclically. For an axis that is not an axis of the frame the body is left as it is: its
    parts would fill the matrices that the others empty.
    """
    mass, moment, inertia = body
    nothing, point, ball = ca.SX(1, 1), ca.SX(3, 1), ca.SX(3, 3)
    if joint.kind == FLOATING:  # moves the whole body
        return body, (nothing, point, ball)
    if joint.kind == "prismatic":
        return (mass, moment, ball), (nothing, point, inertia)
    if sorted(abs(entry) for entry in joint.axis) != [0.0, 0.0, 1.0]:
        return body, (nothing, point, ball)
    # Axis ±z of the frame: mass and m z go, and YY as diag(YY, YY, 0), so that XX keeps XX − YY.
    z = [abs(entry) for entry in joint.axis].index(1.0)
    x, y = (z + 1) % 3, (z + 2) % 3
    along, across = ca.SX(3, 1), ca.SX(3, 1)
    along[z], across[x], across[y] = moment[z], moment[x], moment[y]
    round_, rest = ca.SX(3, 3), ca.SX(inertia)
    round_[x, x] = round_[y, y] = inertia[y, y]
    rest[x, x], rest[y, y] = inertia[x, x] - inertia[y, y], 0
    return (nothing, across, ca.sparsify(rest)), (mass, along, round_)
