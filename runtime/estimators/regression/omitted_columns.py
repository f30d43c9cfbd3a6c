"""Score test of columns that a linear fit lacks.

    τ = Y_b β + F φ + Z ζ + e,     T = ‖P_Z r‖² / S

r is the residual of the fit without Z, and P_Z projects on what Z adds to the other columns. T is
χ² with rank P_Z degrees of freedom where ζ = 0, for noise of density S at the frequencies of the
columns. Every Z that is a function of the motion gives a valid test.
Source: Breusch & Pagan 1980 for score tests.

Test of the friction columns of a fit.

Friction that the columns do not describe:

    τ_j = (Y_b β + F φ)_j + ζ₁ s(dq_j) exp(−(dq_j / v)²) + ζ₂ s(dq_j) |τ̂_j|

The two columns of every joint, a Stribeck peak and friction that grows with the load, are the
deviations of gears that viscous, Coulomb and offset columns leave in the residual. The fit of the
inertial parameters takes up a part of them, so that its intervals are too narrow.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from runtime.estimators.regression.coloured_noise import coloured_noise_of_shares, shares_of_basis
from runtime.estimators.regression.posterior import APART, orthonormal, posterior_of
from runtime.estimators.regression.samples import Samples
from runtime.estimators.regression.slow_rows import slow_part
from runtime.library import Array, Library

SIGNIFICANCE = 1e-4
"""Probability of an alarm where the columns are absent or a prior is right. The noise S is known to
some 15 %, which moves T by as much; one in 10 000 leaves room for that within three alarms of a
hundred logs."""
MARGIN = 1.6
"""Factor on the quantile for errors of the model: real arms have friction that no column has. With
the arm of Franka, whose identified model predicts unseen torques to 1.4 %, T of the prior is 1.3 to
1.5 times the quantile; an unknown body of 0.5 kg in its hand gives 1.7 times and more."""
ROWS = 1500
"""Samples that determine a gain to a percent or better."""
EQUATIONS = 14_000
"""Equations of as many samples, above which robots of more than nine joints take fewer of them."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeFit:
    """Least squares of base parameters and friction without a prior, on evenly spread samples."""

    samples: Samples  # the N samples
    scale: Array  # √w_j that the rows are multiplied by, (n,)
    root: Array  # R, which makes the weighted rows X an orthonormal basis Q = X R, (n_b + n k, p)
    basis: Array  # Q of the weighted columns, (N n, p)
    predicted: Array  # weighted torque of the fit, (N n,)
    rest: Array  # weighted residual, (N n,)
    shares: tuple[Array, ...]  # of every frequency that the basis takes up, by `shares_of_basis`

    def slow(self, cosines: int) -> "FreeFit":
        """The fit of the slow part of the rows, the first cosines of time."""
        shape, width = (len(self.samples), self.scale.size), self.basis.shape[1]
        rows = np.column_stack([self.basis, self.predicted + self.rest])
        rows = slow_part(rows.reshape(*shape, -1), cosines).reshape(rows.shape)
        root = posterior_of(rows[:, :-1], rank=APART, lengths=np.ones(width)).root
        basis, target = rows[:, :-1] @ root, rows[:, -1]
        predicted = basis @ (basis.T @ target)
        shares = shares_of_basis(basis.reshape(*shape, -1))
        return FreeFit(
            self.samples, self.scale, self.root @ root, basis, predicted, target - predicted, shares
        )

    def shares_with(self, directions: Array) -> tuple[Array, ...]:
        """Shares beside further orthonormal columns, (N n, k), orthogonal to the basis."""
        added = shares_of_basis(directions.reshape(len(self.samples), self.scale.size, -1))
        return tuple(a + b for a, b in zip(self.shares, added, strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class ScoreTest:
    """Result of the test of columns Z."""

    statistic: float  # T
    quantile: float  # value that T exceeds with the probability `SIGNIFICANCE` where ζ = 0
    density: float  # S, in units of the weights
    columns: Array  # what Z adds to the other columns, (N n, k)


def free_fit(lib: Library, samples: Samples, weights: Array) -> FreeFit | None:
    """Fit base parameters and friction to about `ROWS` evenly spread samples of weights (n,)."""
    if samples.equations < lib.n_joints:
        return None
    # Evenly spread rows: S is estimated from their residuals, correlated or not.
    count = len(samples)
    step = max(1, count // ROWS, count * lib.n_joints // EQUATIONS)
    s = samples.rows(slice(None, None, step))
    scale = np.sqrt(weights)
    rows = np.concatenate([s.base_rows(lib), s.friction_rows()], axis=2) * scale[:, None]
    target = (s.tau * scale).ravel()
    root = posterior_of(rows, rank=APART).root
    basis = rows.reshape(target.size, -1) @ root
    predicted = basis @ (basis.T @ target)
    rest = target - predicted
    if np.linalg.norm(rest) <= APART * np.linalg.norm(target):
        return None
    shares = shares_of_basis(basis.reshape(len(s), scale.size, -1))
    return FreeFit(s, scale, root, basis, predicted, rest, shares)


def score_test(fit: FreeFit, columns: Array) -> ScoreTest | None:
    """Test columns that a fit lacks."""
    added = columns - fit.basis @ (fit.basis.T @ columns)
    directions = orthonormal(added, APART, np.linalg.norm(columns, axis=0), least=1.0)
    if not directions.shape[1]:
        return None
    explained = directions.T @ fit.rest
    shape = (len(fit.samples), fit.scale.size)
    left = (fit.rest - directions @ explained).reshape(shape)
    unknowns = fit.basis.shape[1] + directions.shape[1]
    density = coloured_noise_of_shares(fit.shares_with(directions), left, unknowns).density
    if not density > 0:
        return None
    quantile = float(chdtri(directions.shape[1], SIGNIFICANCE))
    return ScoreTest(float(explained @ explained) / density, quantile, density, added)


PEAK, SIGN = 0.15, 0.05
"""Speed v of the peak and width of the sign s, over the root mean square speed of a joint."""


@dataclass(frozen=True, slots=True, eq=False)
class FrictionTest:
    """Result of the test."""

    excess: float  # statistic of all joints over the value that it seldom exceeds
    # excess of the columns of every joint alone, (n,); zeros where `excess` is 1 or less
    joints: Array

    @property
    def is_contradicted(self) -> bool:
        """Whether the residuals contain friction that no column describes."""
        return self.excess > 1

    def names(self, lib: Library) -> list[str]:
        """Joints whose own columns are contradicted, or the one with the largest excess."""
        largest = float(self.joints.max())
        chosen = np.flatnonzero(self.joints >= min(1.0, largest))
        return [lib.joint_names[int(k)] for k in chosen]


def friction_test(fit: FreeFit) -> FrictionTest | None:
    """Test the friction columns of a fit."""
    columns, moving = friction_columns(fit)
    test = score_test(fit, columns)
    if test is None:
        return None
    joints = np.zeros(fit.scale.size)
    excess = test.statistic / test.quantile
    for k, joint in enumerate(moving if excess > 1 else ()):
        added = orthonormal(test.columns[:, 2 * k : 2 * k + 2], APART)
        explained = added.T @ fit.rest
        quantile = float(chdtri(max(added.shape[1], 1), SIGNIFICANCE))
        joints[joint] = float(explained @ explained) / test.density / quantile
    return FrictionTest(excess, joints)


def friction_columns(fit: FreeFit) -> tuple[Array, list[int]]:
    """The two columns of every joint that moves."""
    dq, n = fit.samples.dq, fit.scale.size
    speed = np.sqrt(np.mean(dq**2, axis=0))
    moving = speed > 0
    unit = np.where(moving, speed, 1.0)
    sign = np.tanh(dq / (SIGN * unit))
    load = np.abs(fit.predicted.reshape(-1, n))
    columns = np.zeros((len(dq), n, n, 2))
    columns[:, range(n), range(n), 0] = sign * np.exp(-((dq / (PEAK * unit)) ** 2))
    columns[:, range(n), range(n), 1] = sign * load
    return columns[:, :, moving].reshape(len(dq) * n, -1), [int(k) for k in np.flatnonzero(moving)]
