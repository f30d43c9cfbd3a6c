"""Bounds of friction coefficients, and least squares that respects them by an active set.

    lower ≤ φ ≤ upper,   |φ_jk| rms C_jk ≤ MOST rms τ_j,   φ_jk ≥ 0 for viscous, Coulomb, rotor, …

`within_bounds` solves without bounds first. Coefficients beyond a bound are held there, those whose
multiplier has the wrong sign are released, and the problem is solved again; at the end the
Karush–Kuhn–Tucker conditions hold. Source: Portugal, Júdice & Vicente 1994 (block pivoting).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from runtime.estimators.problem import Problem
from runtime.estimators.regression.factor import Statistics
from runtime.estimators.regression.posterior import posterior_of
from runtime.library import Array, Mask
from runtime.recording.settings import names_where

MOST = 10.0
"""Largest torque of one friction column, RMS over that of the joint: columns that cancel each other
may exceed the torque, but ten times is beyond what a motion can determine."""
ROUNDS = 20  # limit of the number of solutions; two or three are usual
BLOCKED = 5  # solutions after which one coefficient at a time is exchanged, which cannot cycle
MULTIPLIER = 1e-9  # multiplier, relative to column times torque, below which it counts as zero

NEGATIVE = 0.01
"""Torque of a negative coefficient relative to that of the joint above which its cause is stated;
below it is within the errors of friction models."""
EVIDENCE = 0.05
"""Evidence for a coefficient above which its cause is stated. 1000 rows of 7 joints, a tenth of
them effective, determine a coefficient to 0.04; correct simulated logs reach 0.017, those with a
reversed joint at least 0.1."""
TINY = 1e-300  # smallest divisor: an exact fit has no residual
NEGATIVE_CAUSE = (
    "a joint is not driven by its friction or its rotor: a velocity or torque is reversed, joints "
    "are exchanged, a gear ratio is missing, or the friction falls with speed; check the log with "
    "symgen inspect"
)

ERROR_OF = "error of "  # before the name of a sensor whose error is a column
OF = " of "  # between the name of a column and that of its joint

Answer = TypeVar("Answer")


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """Bounds of φ."""

    lower: Array  # (n k,) [N·m per unit of the column]
    upper: Array  # (n k,)


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """Coefficients that ended at a bound."""

    flags: Mask  # which, (n k,)
    free: Array  # φ of the solution without bounds, (n k,)
    phi: Array  # φ within the bounds, (n k,)
    # |φ| of the solution without bounds times the length of the part of its column that no other
    # column produces, relative to the residual of that solution; (n k,)
    evidence: Array


def bounds_of(problem: Problem, is_passive: bool) -> Bounds:
    """Bounds of the friction coefficients of a problem."""
    train = problem.train
    columns = train.column_sizes()
    torque = np.sqrt(np.mean(np.square(train.tau), axis=0))
    # A motor drives several joints, and rows of power belong to no joint.
    shared = train.coupling is not None or train.equations < len(columns)
    size = np.full(len(columns), np.linalg.norm(torque)) if shared else torque
    none, most = np.zeros_like(columns), MOST * size[:, None]
    upper = np.divide(most, columns, out=none, where=columns > 0).ravel()
    lower = -upper
    if is_passive:
        lower = np.where(_nonnegative(problem.friction_names, train.shape), 0.0, lower)
    return Bounds(lower, upper)


def within_bounds(
    statistics: Statistics,
    bounds: Bounds,
    solve: Callable[[Statistics], tuple[Array, Array, Answer]],
) -> tuple[Array, Answer, Held]:
    """Solve a least-squares problem with φ within bounds: solve (n k,) → (n k,)."""
    lower, upper = bounds.lower, bounds.upper
    columns = statistics.factor[:, statistics.n_base :]
    lengths = np.linalg.norm(columns, axis=0)
    torque = np.sqrt(statistics.target @ statistics.target + statistics.rest)
    tolerance = MULTIPLIER * lengths * torque
    phi, beta, answer = solve(statistics)
    first = np.concatenate([beta, phi])
    free, side = phi, np.zeros(lengths.size, dtype=int)  # −1 at the lower bound, 1 at the upper
    for k in range(ROUNDS):
        residual = statistics.factor @ np.concatenate([beta, phi]) - statistics.target
        slope = columns.T @ residual
        # Held at the lower bound the loss must rise with φ, at the upper one with −φ.
        wrong = np.where(side != 0, side * slope > tolerance, False)
        below = (side == 0) & (phi < lower) & (lengths > 0)
        above = (side == 0) & (phi > upper) & (lengths > 0)
        exchange = wrong | below | above
        if not exchange.any():
            break
        if k >= BLOCKED:
            exchange &= np.arange(exchange.size) == np.flatnonzero(exchange)[-1]
        side = np.where(exchange, np.where(wrong, 0, np.where(below, -1, 1)), side)
        held = side != 0
        values = np.where(side < 0, lower, upper)
        phi, beta, answer = solve(statistics.holding(held, values) if held.any() else statistics)
        phi = np.where(held, values, phi)
    # The limit of rounds is a safeguard against rounding: the answer is kept within the bounds.
    held = side != 0
    phi = np.clip(phi, lower, upper)
    return phi, answer, Held(held, free, phi, _evidence(statistics, first, held))


def notes_of(
    held: Held, bounds: Bounds, joints: Sequence[str], names: Sequence[str]
) -> tuple[str, ...]:
    """Sentences on coefficients that ended at a bound."""
    if not held.flags.any():
        return ()
    names = names or [f"column {k + 1}" for k in range(len(held.phi) // len(joints))]
    at = [f"{name}{OF}{joint}" for joint in joints for name in names]
    if len(names) == len(held.phi) and all(OF in name for name in names):  # of one joint each
        at = list(names)
    # The upper bound is where the torque is `MOST` times that of the joint. Columns that almost
    # cancel each other have large coefficients of both signs, for which there is no evidence.
    share = MOST * np.abs(held.free) / np.where(bounds.upper > 0, bounds.upper, 1.0)
    is_zero = held.flags & (held.phi == 0)

    def listed(flags: Mask) -> str:
        return ", ".join(f"{at[i]} ({held.free[i]:.3g} unbounded)" for i in np.flatnonzero(flags))

    is_large = (share > NEGATIVE) & (held.evidence > EVIDENCE)
    small, large = is_zero & ~is_large, is_zero & is_large
    limit = held.flags & ~is_zero
    notes = []
    if large.any():
        notes.append(f"negative coefficients were bounded by 0: {listed(large)}; {NEGATIVE_CAUSE}")
    if small.any():
        notes.append(
            f"coefficients near 0, or hardly determined, were bounded by 0: {listed(small)}"
        )
    if limit.any():
        notes.append(
            f"the motion does not determine the friction columns {listed(limit)}; they were held "
            f"where their torque is {MOST:g} times that of the joint; leave them out"
        )
    return tuple(notes)


def negative_share(columns: Array, tau: Array, phi: Array, names: Sequence[str]) -> Array:
    """Torque (n, k) of negative coefficients that should be ≥ 0, relative to the joint's."""
    shape = columns.shape[1:]
    size = np.sqrt(np.mean(np.square(columns), axis=0)) * np.abs(phi)
    torque = np.sqrt(np.mean(np.square(tau), axis=0))
    share = np.divide(size, torque[:, None], out=np.zeros(shape), where=torque[:, None] > 0)
    return np.where((phi < 0) & _nonnegative(names, shape).reshape(shape), share, 0.0)


def _evidence(statistics: Statistics, first: Array, held: Mask) -> Array:
    """Residual that each held column alone removes, relative to that of the solution `first`."""
    if not held.any():
        return np.zeros(held.size)
    residual = statistics.factor @ first - statistics.target
    size = np.sqrt(residual @ residual + statistics.rest)
    # A column has the length 1/σ apart from all others; it is 0 where they explain it.
    apart = np.nan_to_num(1 / posterior_of(statistics.factor).sigma[statistics.n_base :])
    evidence = np.abs(first[statistics.n_base :]) * apart / max(float(size), TINY)
    return np.where(held, evidence, 0.0)


def _nonnegative(names: Sequence[str], shape: tuple[int, ...]) -> Mask:
    """Flag of every coefficient that cannot be negative, (n k,)."""
    known = names_where(lambda column: column.is_nonnegative)
    flags = [name.split(OF)[0] in known for name in names] or [False] * shape[1]
    return np.tile(flags, shape[0])
