"""Errors of a payload beside the noise of its rows: of the arm's model, of gains, and of postures.

    δπ_load = −C Σ Y_kᵀ W A δ,   C = (Σ Y_kᵀ W Y_k)⁻¹

with the offsets taken out of both Y. For an identified arm A = [Y_b, F], and δ(β, φ) has the
covariance of its posterior and the usual change of friction from day to day; where the residual is
far from both, every direction of δ that it shows is as large as it shows. For others A = Y and
δ ~ N(0, s² R Rᵀ), with R Rᵀ the spread of the inertial prior, 25 % of every direction, and s ≤ 1
the scale of it that the residual supports: an arm that fits to a percent is not 25 % off. Against
an empty run of the same motion the errors of the arm cancel.

The gains of the torque sensors are a fixed error too, which a longer log does not average out:

    τ_measured,j = (1 + g_j) τ_j,   g_j ~ N(0, s²),   δπ = Σ_j g_j C Σ Y_kjᵀ τ_j / σ_j²

with the offsets taken out of Y and τ, and s at most the expected one, by what the residual shows of
it (`model_error.change_error`). Against an empty run, and with a model that was identified by the
same sensors, the gains act on the torque of the payload alone.

Against an empty run of another day the usual change of friction and gains from day to day is an
error: one size in common, which the residual shows and which is next to 0 within one session.

`posture_error` is the error beside the payload that repeats with a joint's position,

    u_g = (A − A_g)⁻¹ s_g,   s_g = Σ_{i in g} Y_iᵀ W e_i,   V = t² (K − 1)/K Σ_g (u_g − ū)²

A spring, a cable, or torque that no model has returns wherever the posture returns, so that periods
of a motion do not average it, and residuals that are correlated in time do not show it. u_g is the
change of π without the rows g, a K-th of them that are neighbours in the position of a joint. t is
the 95 % quantile of Student's t with K − 1 degrees of freedom over that of the normal distribution.
Source: delete-a-group jackknife, Efron & Stein 1981; the scale by the method of moments and groups
of postures are ours.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.common.files import folder_of
from runtime.estimators.convex.entropic_prior import CAD, bodies_of, prior_of
from runtime.estimators.regression.model_error import change_error
from runtime.estimators.regression.posterior import least_squares
from runtime.estimators.regression.samples import NORMAL_95, Samples
from runtime.identification import posterior_file
from runtime.identification.identified import Identification
from runtime.identification.saved_result import POSTERIOR, read_result, require_model
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording import Friction, Recording
from runtime.recording.friction.model import DAY, LARGE_DAY, columns
from runtime.recording.settings import JointMotion

LEAST_TRAVEL = 0.02  # smallest travel that the distance is related to, rad or m
GROUPS = 5  # K, groups of rows per joint
FEW = 2.7764451051977934 / NORMAL_95  # t of K groups, which know their variance badly
SIGNIFICANT = 12.0
"""Variance by groups over that of the noise from which it is said. Of 7 joints and 10 entries the
largest ratio in 24 runs of an FR3 with white and coloured noise is 10.6: the groups are few, and
those at the ends of a range weigh most."""
COUNTED = 6.0
"""The same of the mass from which intervals contain it. In 200 runs of an FR3 with white noise and
noise below 10, 3, 1 and 0.3 Hz it is exceeded in 5; a load of 105 g on a PSM has 7.5 to 19 at 1 to
2 Hz, and 18 to 99 above."""
_BLOCK = 4096
_RANK = 1e-10  # eigenvalue over the largest below which errors of the arm change no torques
UNEXPECTED = 2.0
"""Squared residual along the errors of the arm over its expectation from which the arm has changed:
.3 to 1.3 on 14 logs of simulated arms of another day and .8 to 1 on a PSM of the same day; 2.3 to
8.1 with a quarter more friction or 60 %, 3.5 to 4.8 on the PSM of another day."""
_FEW = 2.0  # factor on s² for the few directions, about twenty, that dominate its estimate


@dataclass(frozen=True, slots=True)
class ArmModel:
    """Parameters and friction of the arm, fixed while the payload is identified."""

    pi: Array  # standard parameters, (10 n,)
    friction: Friction  # friction columns and widths
    phi: Array  # friction coefficients, (n, k)
    origin: str  # source of the model, for the report
    # root of the covariance of [β; φ] for readings of the same sensors, (n_b + n k, m); None where
    # no posterior states it
    root: Array | None = None
    is_exact: bool = False  # no model error enters a payload's intervals; for simulated arms


def arm_model(lib: Library) -> ArmModel:
    """The URDF's parameters without friction."""
    return ArmModel(lib.pi0, Friction(()), np.zeros((lib.n_joints, 0)), "the URDF, no friction")


def arm_of_result(result: Identification) -> ArmModel:
    """An identified arm, whose errors are those of its posterior."""
    posterior, lib, phi = result.posterior, result.lib, result.usual_phi
    root = None if posterior is None else _root(posterior, lib, phi)
    return ArmModel(result.pi, result.friction, phi, "identified", root)


def read_arm_model(path: Path, lib: Library) -> ArmModel:
    """Read the arm from a result of identify."""
    saved, root = read_result(path), None
    origin = "; ".join((f"identified, '{path}'", *require_model(saved.record, lib, path)))
    if (folder_of(path) / POSTERIOR).exists():
        root = _root(posterior_file.read_posterior(path, saved, lib), lib, saved.phi)
    return ArmModel(saved.pi, saved.friction, saved.phi, origin, root)


def _root(posterior: posterior_file.SavedPosterior, lib: Library, phi: Array) -> Array:
    """Root of the covariance of [β; φ] on another day, (n_b + n k, m)."""
    root, day = posterior.of_readings().root(lib), np.diag(DAY * phi.ravel())
    return np.hstack([root, np.vstack([np.zeros((len(root) - len(day), len(day))), day])])


@dataclass(frozen=True, slots=True, eq=False)
class Residual:
    """What a payload leaves of the torques of N instants."""

    columns: Array  # Y_k, (N, n, 10)
    errors: Array  # e, (N, n), of the noise times the root of the density
    noise: Array  # (N, n) or (n,); infinite where a row is left out
    shape: Array  # C, covariance of π at unit noise, (10, 10)
    density: float = 1.0

    @property
    def rows(self) -> Array:
        """Columns over the noise of their rows; the offsets take the means."""
        return centred(self.columns, self.noise) / self.noise[..., None]


def posterior_covariance(
    lib: Library, root: Array, samples: Samples, left: Residual
) -> tuple[Array, bool]:
    """Covariance of a payload's π by the posterior of the arm, and whether it expects the residual.

    Errors of the arm that it does not expect are as large as the residual along each of them.
    """

    def columns_of(part: slice) -> Array:
        return samples.rows(part).rows_of_unknowns(lib)

    cross, gram, slope = _products(columns_of, len(root), left)
    power, axes = np.linalg.eigh(root.T @ gram @ root)
    seen = power > _RANK * max(float(power[-1]), 1e-300)
    along = (axes[:, seen].T @ (root.T @ slope)) ** 2 / power[seen]
    usual, moved = power[seen] + left.density, left.shape @ cross @ root @ axes
    is_expected = bool(along.sum() <= UNEXPECTED * usual.sum())
    if not is_expected:
        moved[:, seen] *= np.sqrt(np.maximum(along / usual, 1.0))
    return np.asarray(moved @ moved.T), is_expected


def arm_covariance(lib: Library, model: ArmModel, run: Recording, left: Residual) -> Array:
    """Covariance of a payload's π by the prior of the arm, as wide as the residual makes likely."""
    # R of the arm: block-diagonal root of the prior's spread at its parameters.
    spread = bodies_of(lib).spread(prior_of(lib, model.pi).centre) / np.sqrt(CAD)
    motion = (run.q, run.required("dq"), run.required("ddq"))

    def columns_of(part: slice) -> Array:
        y = lib.regressor(*(each[part] for each in motion))
        links = y.reshape(*y.shape[:2], lib.n_links, N_PARAMETERS)
        return np.asarray(np.einsum("ijkl,klm->ijkm", links, spread).reshape(y.shape))

    cross, gram, slope = _products(columns_of, lib.n_links * N_PARAMETERS, left)
    gain = left.shape @ cross
    # Energy of the residual in the span of the arm's columns, over that of the whole prior: noise
    # enters it by a few dozen of N n equations only.
    energy = float(slope @ np.linalg.pinv(gram, rcond=_RANK, hermitian=True) @ slope)
    scale = min(1.0, _FEW * energy / max(float(np.trace(gram)), 1e-300))
    return np.asarray(scale * gain @ gain.T)


def _products(
    columns_of: Callable[[slice], Array], width: int, left: Residual
) -> tuple[Array, Array, Array]:
    """Yᵀ W A, Aᵀ W A without what Y and offsets explain, and Aᵀ W e; A by its rows."""
    rows, errors, noise = left.rows, left.errors, np.broadcast_to(left.noise, left.errors.shape)
    mean, cross = np.zeros((errors.shape[1], width)), np.zeros((N_PARAMETERS, width))
    gram, slope = np.zeros((width, width)), np.zeros(width)
    for i in range(0, len(rows), _BLOCK):
        part = slice(i, i + _BLOCK)
        arm = columns_of(part) / noise[part, :, None]
        flat = arm.reshape(-1, width)
        cross += rows[part].reshape(-1, N_PARAMETERS).T @ flat
        gram += flat.T @ flat
        slope += (errors[part] / noise[part]).ravel() @ flat
        mean += arm.sum(axis=0)
    # The offsets take the means; the payload takes what its columns explain of the rest.
    flat = rows.reshape(-1, N_PARAMETERS)
    taken = np.linalg.pinv(flat.T @ flat, rcond=_RANK, hermitian=True) @ cross
    slope -= taken.T @ (flat.T @ (errors / noise).ravel())  # which the prior of the payload leaves
    mean /= np.sqrt(np.isfinite(noise).sum(axis=0))[:, None]
    return cross, gram - mean.T @ mean - cross.T @ taken, slope


def means_of(values: Array, noise: Array) -> Array:
    """Means (n, …) of values (N, n, …) over the rows of finite noise, (N, n) or (n,)."""
    is_used = np.isfinite(np.broadcast_to(noise, values.shape[:2]))
    weights = is_used / is_used.sum(axis=0)
    return np.asarray(np.einsum("ij,ij...->j...", weights, values))


def centred(values: Array, noise: Array) -> Array:
    """Values (N, n, …) without these means, and 0 in rows of infinite noise."""
    is_used = np.isfinite(noise).reshape(*noise.shape, *(1,) * (values.ndim - 2))
    return np.where(is_used, values - means_of(values, noise), 0.0)


def day_changes(loaded: Samples, empty: Samples, friction: Array, gain: float) -> Array:
    """Usual change of friction and gains between two days, in the loaded run, (N, n, 3).

    friction (N_0, n): torque of the empty run without its links; gain: usual relative change.
    """
    terms = Friction(("viscous", "coulomb", "offset"))
    of_loaded, of_empty = (columns(JointMotion(run.dq), terms) for run in (loaded, empty))
    fits = zip(np.moveaxis(of_empty, 1, 0), friction.T, strict=True)
    sizes = np.array([least_squares(rows, torque)[0] for rows, torque in fits])
    usual = LARGE_DAY * sizes[:, :2] * of_loaded[..., :2]
    return np.concatenate([usual, gain * loaded.tau[..., None]], axis=2)


def change_covariance(left: Residual, torque: Array, expected: float) -> tuple[Array, float]:
    """Covariance of a payload's π by independent changes of a size, and the size, if `expected`.

    torque (N, n, m): that of changes of size 1 of every joint.
    """
    sizes, axes = np.linalg.eigh(left.shape)
    root = axes * np.sqrt(np.maximum(sizes, 0.0))
    varying = centred(torque, left.noise) / left.noise[..., None]
    taken = root.T @ np.einsum("ijk,ijl->kjl", left.rows, varying).reshape(len(root), -1)
    moved, sigma = change_error(taken, varying, left.errors / left.noise, left.density, expected)
    moved = root @ moved
    return moved @ moved.T, sigma


@dataclass(frozen=True, slots=True, eq=False)
class PostureDeviation:
    """Errors that repeat with the position of a joint."""

    joint: str  # its name
    factors: Array  # of the standard deviations of π, (10,), at least 1
    is_sure: bool  # whether more than noise shows them

    @property
    def sentence(self) -> str:
        """Note of the result."""
        return (
            "the torque beside the payload has errors that repeat with the position of "
            f"'{self.joint}': the intervals contain them (mass: {self.factors[0]:.1f} times the "
            "noise); check the setting link, and record both runs with the same cables, springs "
            "and temperature"
        )

    def widened(self, covariance: Array) -> Array:
        """Covariance of π (10, 10) with the standard deviations times the factors."""
        return self.factors[:, None] * covariance * self.factors


def posture_error(
    run: Recording, names: Sequence[str], rows: Array, errors: Array, shape: Array, of_pi: Array
) -> PostureDeviation | None:
    """Errors that repeat with the position of the joint where they are largest."""
    whole, variance, q = np.linalg.inv(shape), np.diagonal(of_pi), run.q
    worst, largest = None, (False, 1.0)
    for joint in np.flatnonzero(np.ptp(q, axis=0) > LEAST_TRAVEL):
        edges = np.quantile(q[:, joint], np.arange(1, GROUPS) / GROUPS)
        group = np.searchsorted(edges, q[:, joint])
        changes = []
        for k in range(GROUPS):
            part = rows[group == k].reshape(-1, rows.shape[2])
            score = part.T @ errors[group == k].ravel()
            changes.append(np.linalg.solve(whole - part.T @ part, score))
        ratio = (GROUPS - 1) * np.var(changes, axis=0) / variance
        sure = float(ratio.max()) / SIGNIFICANT
        size = sure > 1.0, max(float(ratio[0]) / COUNTED, sure)  # what is said comes first
        if size > largest:
            factors = np.maximum(FEW * np.sqrt(ratio), 1.0)
            worst, largest = PostureDeviation(names[int(joint)], factors, size[0]), size
    return worst
