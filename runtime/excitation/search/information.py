"""Information of a motion about chosen unknowns, with that of earlier logs, and its slope.

Torque with white noise of standard deviation σ_j on joint j, sampled at a rate f for t_f seconds,
gives least squares the information Tᵀ (f t_f · mean_k Y_bᵀ diag(σ⁻²) Y_b + G₀) T: its inverse is
the covariance of the unknowns x in β = β₀ + T x. G₀ comes from earlier logs; T selects unknowns,
such as the ten of a payload on an arm that is known. Friction and offset of every joint are unknown
too: the part of Y_b that their columns explain determines nothing, and is projected out of it. For
coloured noise and a planned filter rows and columns count frequency by frequency:

    G = Σ_k w(f_k)² ŷ_kᵀ ŷ_k / σ²,    w² = |H(f)|² σ² / S(f),    f_k = k / 2T

ŷ_k are orthonormal cosines of the rows over their time T. A motion out and back is even in time:
the cosines of its first half are its harmonics k / t_f, and the sum is exact. S is the density of
the noise of joint j per row, σ² for white noise; friction that no column describes, gains and
delays are part of the S of a log. H is the zero-phase Butterworth filter of the fourth order that
the log will pass: what a motion has beyond its cut-off determines nothing.
Source: Pintelon & Schoukens 2012, Ch. 2 (information of periodic excitation in coloured noise).

Friction columns that are estimated beside the unknowns: least squares on [Y F] has the information
R'R over the unknowns of Y, with the rows of every joint

    R_j = Y_j − F_j X_j,        X_j = (F_jᵀF_j)⁻¹ F_jᵀ Y_j,        F_jᵀ R_j = 0,

because the columns F of a joint act on its own torque alone. A function of RᵀR with ∂f/∂R = R S has

    ∂f/∂Y_j = R_j S,        ∂f/∂F_j = −R_j S X_jᵀ.

On a motion out and back the rows of an inertial regressor are even in dq: columns that are odd in
dq are orthogonal to them and drop out.

A `SpectralFunction` takes the eigenvalues λ, ascending and positive, of the Gram matrix C = D^-½ G
D^-½, D = diag G, of columns of unit length, and returns f and ∂f/∂λ: lengths of columns have no
effect. A `Measure` takes G = WᵀW of a regressor W and returns f and S = 2 ∂f/∂G, so that
∂f/∂W = W S. A `ConditionCost` is a measure along a trajectory as a function of its coefficients.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.fft import dct

from runtime.errors import IdentificationError, RecordingError
from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import COSINE
from runtime.library import Array, Library
from runtime.library.compiled_programs import CompiledExcitation
from runtime.recording import Friction
from runtime.recording.friction.columns import OFFSET
from runtime.recording.friction.model import columns
from runtime.recording.settings import COLUMNS, JointMotion

SpectralFunction = Callable[[Array], tuple[float, Array]]
Measure = Callable[[Array], tuple[float, Array]]

COST_SAMPLES = 80  # samples of the cost over the whole duration (document Sec. 3.4.2)
INFORMED_SAMPLES = 240
"""Samples of a cost that counts noise and friction, over the whole duration.

With 80 the search finds motions that are good at these samples: the expected torque error of a
design for criterion a was a quarter larger over 1000 samples than over 80. With 240 it is 2 %.
"""
_CHUNK = 16  # trajectories per batch: their regressors stay in the cache
_DIFFERENCE = 1e-6  # step in dq, rad/s: truncation 1e-9 at ε = 0.02, rounding 1e-10
_SINGULAR = 1e-12  # eigenvalue of a correlation, below which columns are equal
_PROBE = np.linspace(-2.0, 2.0, 41)[:, None]  # speeds of the test for odd columns [rad/s, m/s]


def require_of_speed(names: tuple[str, ...]) -> None:
    """Refuse columns that are not functions of the speed of a joint."""
    unusable = tuple(name for name in names if name in COLUMNS and not _is_of_speed(name))
    if unusable:
        usable = ", ".join(name for name in COLUMNS if _is_of_speed(name))
        raise IdentificationError(
            "a motion is designed with friction columns that are functions of a joint's speed, got "
            f"{', '.join(unusable)}; choose from {usable}, or none"
        )
    columns(JointMotion(_PROBE), Friction(names))


def _is_of_speed(name: str) -> bool:
    record = COLUMNS[name]
    if record.is_inertial or record.of_motors or record.signals:
        return False
    try:
        record.function(JointMotion(_PROBE), Friction())
    except RecordingError:
        return False
    return True


def even_columns(names: tuple[str, ...]) -> tuple[str, ...]:
    """Columns that are not odd in dq, those that a motion out and back does not separate."""
    values = columns(JointMotion(_PROBE), Friction(names))
    # A sum of two roundings of numbers of size one.
    is_odd = np.abs(values + values[::-1]).max(axis=(0, 1), initial=0.0) < 1e-12
    return tuple(name for name, odd in zip(names, is_odd, strict=True) if not odd)


@dataclass(frozen=True, slots=True)
class Projection:
    """A regressor less its part along friction columns."""

    rows: Array  # R, (K, N, n, k)
    shares: Array  # X, (K, n, m, k)
    slopes: Array  # ∂F/∂dq, (K, N, n, m)
    filtered: Array | None = None  # A per joint, (n, N, N) or (1, N, N), if rows passed it

    def seed_of_speed(self, seed: Array) -> Array:
        """Gradient in dq, (K, N, n), by way of the friction columns."""
        along = (seed.transpose(0, 2, 1, 3) @ self.shares.swapaxes(2, 3)).transpose(0, 2, 1, 3)
        if self.filtered is not None:
            along = in_time(self.filtered.transpose(0, 2, 1), along)
        return -np.einsum("ktjm,ktjm->ktj", along, self.slopes)


def in_time(matrix: Array, rows: Array) -> Array:
    """Products (K, M, n, k) of matrices (n, M, N) and rows (K, N, n, k) along time."""
    return np.asarray(np.matmul(matrix, rows.transpose(0, 2, 1, 3)).transpose(0, 2, 1, 3))


def projected(
    rows: Array, dq: Array, names: tuple[str, ...], filtered: Array | None = None
) -> Projection:
    """Project friction columns out of a regressor."""
    terms = Friction(names)

    def at(speed: Array) -> Array:
        flat = speed.reshape(-1, speed.shape[-1])
        return columns(JointMotion(flat), terms).reshape(*speed.shape, -1)

    friction = at(dq)
    slopes = (at(dq + _DIFFERENCE) - at(dq - _DIFFERENCE)) / (2 * _DIFFERENCE)
    if filtered is not None:
        friction = in_time(filtered, friction)
    # Joint by joint, with time as the first axis of a matrix: (K, n, N, m) and (K, n, N, k).
    of_joints, friction = rows.transpose(0, 2, 1, 3), friction.transpose(0, 2, 1, 3)
    size = np.sqrt(np.square(friction).sum(axis=2))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    unit = friction * scale[:, :, None]
    gram, cross = unit.swapaxes(2, 3) @ unit, unit.swapaxes(2, 3) @ of_joints
    if len(names) == 1:  # the square of a rounded length is not quite one
        shares = cross / np.where(gram > 0, gram, 1.0)
    else:
        shares = np.linalg.pinv(gram, rcond=_SINGULAR, hermitian=True) @ cross
    rest = (of_joints - unit @ shares).transpose(0, 2, 1, 3)
    return Projection(rest, shares * scale[..., None], slopes, filtered)


ORDER = 4  # order of the filter, which runs forwards and backwards
BANDS, LEAST_BINS = 24, 16  # of an estimated spectrum, equally wide in log f; bins in one
NOISE = 0.05  # default torque noise, N·m or N
RATE = 100.0  # default sampling rate of the log, Hz
FRICTION = Friction().columns  # friction columns that are estimated beside base parameters


@dataclass(frozen=True, slots=True, eq=False)
class NoiseSpectrum:
    """Noise density over frequency, and the planned filter."""

    frequency: Array  # centres of bands, (B,) Hz, rising; empty for white noise
    density: Array  # S / σ² of every joint, (B, n)
    cutoff_hz: float | None = None  # of the planned low-pass; None without

    def __post_init__(self) -> None:
        if self.cutoff_hz is not None and not 0 < self.cutoff_hz < np.inf:
            raise IdentificationError(
                f"expected a cut-off above 0 Hz, got {self.cutoff_hz:g}; 10 Hz is usual"
            )

    def amplitudes(self, frequency: Array) -> Array:
        """w(f) of every joint, (F, n)."""
        weight = np.ones((len(frequency), 1))
        if len(self.frequency):
            densities = [np.interp(frequency, self.frequency, one) for one in self.density.T]
            weight = np.stack(densities, axis=1)
            weight = 1 / np.sqrt(weight)
        if self.cutoff_hz is not None:
            weight = weight / (1 + (frequency / self.cutoff_hz) ** (2 * ORDER))[:, None]
        return np.asarray(weight)

    def weighted_cosines(self, count: int, step: float) -> Array:
        """Matrix A with G = Σ_j (A_j Y_j)ᵀ (A_j Y_j) / σ_j²."""
        frequency = np.arange(count) / (2 * count * step)
        turn = dct(np.eye(count), axis=0, norm="ortho")
        return np.asarray(self.amplitudes(frequency).T[:, :, None] * turn)


@dataclass(frozen=True, slots=True)
class Information:
    """Data from which the regressor of a motion becomes information."""

    noise: Array  # σ, (n,) N·m or N
    rate: float = RATE  # f, Hz
    earlier: Array | None = None  # G₀ of earlier logs over β, (n_b, n_b); None without
    columns: Array | None = None  # T, (n_b, k); None is the identity
    friction: tuple[str, ...] = ()  # columns of every joint that are estimated beside the unknowns
    spectrum: NoiseSpectrum | None = None  # of noise and planned filter; None: white, no filter
    # places in β of the parameters that T leaves out one by one, because no motion shows them
    # (`unseen_parameters`); empty where T is a payload's
    left_out: tuple[int, ...] = ()

    def of_mean(self, mean: Array, duration: float) -> Array:
        """Information of the unknowns."""
        gram = mean * (self.rate * duration)
        return self.of_unknowns(gram if self.earlier is None else gram + self.earlier)

    def of_unknowns(self, gram: Array) -> Array:
        """Tᵀ G T of a G over β, (k, k)."""
        return gram if self.columns is None else self.columns.T @ gram @ self.columns

    def to_mean(self, slope: Array, duration: float) -> Array:
        """Adjoint of `of_mean`: ∂f/∂mean from ∂f/∂information."""
        if self.columns is not None:
            slope = self.columns @ slope @ self.columns.T
        return slope * (self.rate * duration)


def information(
    lib: Library,
    noise: float | Array = NOISE,
    rate: float = RATE,
    earlier: Array | None = None,
    payload: bool = False,
    friction: tuple[str, ...] | None = None,
) -> Information:
    """Information with its numbers checked."""
    sigma = np.asarray(noise, dtype=float)
    possible = np.isfinite(sigma).all() and (sigma > 0).all()
    if sigma.shape not in {(), (1,), (lib.n_joints,)} or not possible:
        raise IdentificationError(
            f"expected a torque noise above 0 N·m, one number or {lib.n_joints} of them, got "
            f"{np.array2string(sigma, separator=', ')}; {NOISE} is usual"
        )
    if not (np.isfinite(rate) and rate > 0):
        raise IdentificationError(f"expected a sampling rate above 0 Hz, got {rate:g}")
    shape = (len(lib.base_columns),) * 2
    if earlier is not None and (earlier.shape != shape or not np.isfinite(earlier).all()):
        raise IdentificationError(
            f"expected information of earlier logs of shape {shape}, finite, "
            f"got {earlier.shape}; make it from logs of this robot"
        )
    columns = lib.base_matrix[:, -10:] if payload else None
    if friction is None:
        friction = (OFFSET.name,) if payload else FRICTION
    require_of_speed(friction)
    noises = np.broadcast_to(sigma, lib.n_joints).copy()
    return Information(noises, rate, earlier, columns, friction)


def spectrum_of(rest: Array, rate: float, cutoff_hz: float | None = None) -> NoiseSpectrum:
    """Spectrum of the residuals of a log, (N, n) [N·m, N]."""
    power = dct(rest, axis=0, norm="ortho") ** 2
    count = len(power)
    edges = np.unique(np.round(np.geomspace(LEAST_BINS, count, BANDS + 1)).astype(int))
    edges = np.concatenate([[0], edges[:1], edges[1:][np.diff(edges) >= LEAST_BINS]])
    edges[-1] = count
    bands = list(pairwise(edges.tolist()))
    density = np.array([power[a:b].mean(axis=0) for a, b in bands]) / power.mean(axis=0)
    frequency = np.array([(a + b - 1) / 2 for a, b in bands]) * rate / (2 * count)
    # Where the filter has removed the noise, its density is that of the last band before.
    kept = frequency <= (np.inf if cutoff_hz is None else max(cutoff_hz, frequency[0]))
    return NoiseSpectrum(frequency[kept], density[kept], cutoff_hz)


def log_cond(values: Array) -> tuple[float, Array]:
    """½ log λ_max/λ_min = log cond W̄ (Eq. 3.29). Not smooth where extreme eigenvalues meet."""
    slope = np.zeros_like(values)
    slope[-1] += 0.5 / values[-1]
    slope[0] -= 0.5 / values[0]
    return float(np.log(values[-1] / values[0]) / 2), slope


def of_unit_length(gram: Array) -> tuple[Array, Array]:
    """Matrices C of columns of unit length, (…, n_b, n_b), and 1 / lengths of those of G."""
    size = np.sqrt(np.einsum("...ii->...i", gram))
    scale = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0)
    return gram * (scale[..., :, None] * scale[..., None, :]), scale


def normalised(criterion: SpectralFunction) -> Measure:
    """f of the eigenvalues of C as a function of G; without full rank λ counts as n_b ε λ_max."""

    def measure(gram: Array) -> tuple[float, Array]:
        unit, scale = of_unit_length(gram)
        values, vectors = np.linalg.eigh(unit)
        values = np.maximum(values, len(gram) * np.finfo(float).eps * values[-1])
        value, weights = criterion(values)
        z = vectors * scale[:, None]
        slope = 2 * (z * weights) @ z.T
        slope -= np.diag(2 * (z * z) @ (weights * values))
        return value, slope

    return measure


def of_rows(rows: Array, criterion: SpectralFunction) -> tuple[float, Array]:
    """Function of the eigenvalues of C for a regressor (N, n_b)."""
    return normalised(criterion)(rows.T @ rows)


def log_condition(rows: Array) -> tuple[float, Array]:
    """Value log cond W̄ and S (n_b, n_b) with ∂/∂W = W S; W̄ is W (N, n_b) with unit columns."""
    return of_rows(rows, log_cond)


class ConditionCost:
    """log cond W̄_b of a trajectory and its exact gradient in a (Eq. 3.29).

    Columns without full rank, to rounding, count as cond = (n_b ε)^-½. Compiled where the library's
    level has it, else by NumPy. With `information` the Gram matrix is that of the unknowns which it
    names, in units of their inverse covariance, with the information of earlier logs added and with
    its friction columns projected out.
    """

    def __init__(
        self,
        lib: Library,
        home: Array,
        harmonics: int,
        duration: float,
        basis: Basis = COSINE,
        information: Information | None = None,
    ) -> None:
        """Cost for motions of one basis and duration."""
        self._lib, self._home = lib, home
        t = np.linspace(0.0, duration, COST_SAMPLES if information is None else INFORMED_SAMPLES)
        if basis.is_symmetric:
            # A motion out and back passes every sample twice: half of them suffice.
            t = t[: len(t) // 2]
        self._basis = basis.at(lib, harmonics, t, duration)[..., :3]
        self._information, self._duration = information, duration
        self._rows = None
        self._filtered: Array | None = None
        self._nuisance: tuple[str, ...] = ()
        if information is not None:
            self._rows = 1 / (information.noise * np.sqrt(len(t)))
            if information.spectrum is not None:
                self._filtered = information.spectrum.weighted_cosines(len(t), float(t[1] - t[0]))
            names = information.friction
            self._nuisance = even_columns(names) if basis.is_symmetric else names
        self.compiled = None
        if information is None:
            self.compiled = CompiledExcitation.of(lib.binding, home, self._basis)

    def value_gradient(self, coefficients: Array) -> tuple[float, Array]:
        """Cost and gradient ∂cost/∂a, (n, M)."""
        if self.compiled is not None:
            return self.compiled.value_gradient(coefficients)
        return self.by_numpy(coefficients)

    def by_numpy(self, coefficients: Array) -> tuple[float, Array]:
        """The same with the eigenpairs of LAPACK: the reference."""
        return self.measure(coefficients, normalised(log_cond))

    def measure(self, coefficients: Array, measure: Measure) -> tuple[float, Array]:
        """Any measure of the Gram matrix.

        Args:
            coefficients: a, (n, M).
            measure: function of the Gram matrix.

        Returns:
            Its value and its gradient in a, (n, M).
        """
        motion, rows, friction = self._regressor(coefficients[None])
        value, slope = measure(self._of_mean(rows[0].T @ rows[0]))
        return value, self._back(motion, (rows[0] @ self._to_mean(slope))[None], friction)[0]

    def correlations(self, coefficients: Array) -> Array:
        """Matrices C = W̄ᵀW̄ of K trajectories, (K, n_b, n_b), from a (K, n, M)."""
        rows = self._regressor(coefficients)[1]
        return of_unit_length(self._of_mean(rows.transpose(0, 2, 1) @ rows))[0]

    def correlations_slopes(self, coefficients: Array, weight: Array) -> tuple[Array, Array]:
        """Matrices C and gradients of ⟨F, C⟩ for a constant symmetric F.

        Args:
            coefficients: a of K trajectories, (K, n, M).
            weight: F, (n_b, n_b).

        Returns:
            C, (K, n_b, n_b), and ∂⟨F, C⟩/∂a, (K, n, M).
        """
        matrices, slopes = [], []
        for first in range(0, len(coefficients), _CHUNK):
            motion, rows, friction = self._regressor(coefficients[first : first + _CHUNK])
            correlation, scale = of_unit_length(self._of_mean(rows.transpose(0, 2, 1) @ rows))
            # C depends on W also through the lengths of its columns: the diagonal of F C.
            slope = 2 * weight - 2 * np.einsum("ij,kij->ki", weight, correlation)[:, None, :] * (
                np.eye(len(weight))
            )
            slope *= scale[:, :, None] * scale[:, None, :]
            matrices.append(correlation)
            slopes.append(self._back(motion, rows @ self._to_mean(slope), friction))
        return np.concatenate(matrices), np.concatenate(slopes)

    def _regressor(self, a: Array) -> tuple[Array, Array, Projection | None]:
        """States q, dq, ddq (3, K N, n), W (K, N n, n_b) of K trajectories, and its projection."""
        motion = np.einsum("kjm,tmd->dktj", a, self._basis)
        motion[0] += self._home
        samples, n = motion.shape[2:]
        y = self._lib.base_regressor(*motion.reshape(3, -1, n))
        friction = None
        if self._filtered is not None:
            y = in_time(self._filtered, y.reshape(len(a), samples, n, -1)).reshape(y.shape)
        if self._nuisance:
            rows = y.reshape(len(a), samples, n, -1)
            friction = projected(rows, motion[1], self._nuisance, self._filtered)
            y = friction.rows.reshape(-1, n, y.shape[-1])
        if self._rows is not None:
            y = y * self._rows[:, None]
        return motion.reshape(3, -1, n), y.reshape(len(a), -1, y.shape[-1]), friction

    def _back(self, motion: Array, seed: Array, friction: Projection | None) -> Array:
        """Gradients ∂⟨seed, W⟩/∂a, (K, n, M)."""
        samples, n = motion.shape[1:]
        q, dq, ddq = motion
        seed = seed.reshape(samples, n, -1)
        if self._rows is not None:
            seed = seed * self._rows[:, None]
        of_rows = seed
        if self._filtered is not None:
            apart = seed.reshape(-1, len(self._basis), n, seed.shape[-1])
            of_rows = in_time(self._filtered.transpose(0, 2, 1), apart).reshape(seed.shape)
        adjoint = self._lib.regressor_adjoint(q, dq, ddq, of_rows)
        adjoint = adjoint.reshape(-1, len(self._basis), 3, n)
        if friction is not None:
            adjoint[:, :, 1] += friction.seed_of_speed(seed.reshape(friction.rows.shape))
        # Σ over samples and derivatives, (K, n, M).
        return np.tensordot(adjoint, self._basis, axes=([1, 2], [0, 2]))

    def _of_mean(self, gram: Array) -> Array:
        known = self._information
        return gram if known is None else known.of_mean(gram, self._duration)

    def _to_mean(self, slope: Array) -> Array:
        known = self._information
        return slope if known is None else known.to_mean(slope, self._duration)
