"""Recording + library → the weighted torque loss and its gradient.

L(λ, φ) = (1/N) Σ ½ rᵀ W r,  r = Y π(λ) + F φ − τ (Eqs. 4.5, 4.6), with friction F φ as an option.
The unknowns are x = [λ, ψ]: φ = ψ · unit, where one unit of ψ moves the torque of its joint by as
much as a relative change of one in λ does, so that one step size serves both.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime import friction
from runtime.errors import IdentificationError, NeedsError
from runtime.library import Array, Library
from runtime.recording import Recording

THESIS_SIGMA = 0.5
"""Regularisation of Eq. 4.8, N·m."""

FROM_STATISTICS = ("map", "adam", "lm", "log-cholesky", "pc-ols", "ols", "wls")
"""Methods that need of the samples what compressed statistics keep: they take streamed logs, and
rows in which accelerations have been integrated away; adam all samples at once."""


def thesis_weights(tau: Array) -> Array:
    """w_k ∝ 1/(τ_rms,k² + σ²) with mean 1, from the training torque (Eq. 4.8)."""
    raw = 1.0 / (np.mean(tau**2, axis=0) + THESIS_SIGMA**2)
    return raw / raw.mean()


@dataclass(frozen=True, slots=True)
class Samples:
    """Complete motion and torque of a recording, with its friction columns (N, n, k).

    Attributes:
        acceleration: ddq; None where `base` stands for it.
        tau: (N, m): of the joints, or their power where m = 1 and `base` is that of energy.
        coupling: says which columns are of motors that drive several joints.
        base: Y_b of every sample, (N, m, n_b), where it is no function of q, dq and ddq.
    """

    q: Array
    dq: Array
    acceleration: Array | None
    tau: Array
    columns: Array
    coupling: friction.Coupling | None = field(default=None, kw_only=True)
    base: Array | None = field(default=None, kw_only=True)

    def __len__(self) -> int:
        return len(self.q)

    @property
    def ddq(self) -> Array:
        """Accelerations (N, n).

        Raises:
            NeedsError: the rows were made without them.
        """
        if self.acceleration is None:
            raise NeedsError(
                "this needs accelerations, but the rows were made without them; use the regressor "
                f"'acceleration', or a method of {', '.join(FROM_STATISTICS)}"
            )
        return self.acceleration

    @property
    def equations(self) -> int:
        """Per sample: m."""
        return int(self.tau.shape[1])

    def rows(self, taken: slice | NDArray[np.int64]) -> "Samples":
        """Some of the samples, contiguous."""

        def part(values: Array) -> Array:
            return np.ascontiguousarray(values[taken], dtype=float)

        return Samples(
            part(self.q),
            part(self.dq),
            None if self.acceleration is None else part(self.acceleration),
            part(self.tau),
            part(self.columns),
            coupling=self.coupling,
            base=None if self.base is None else part(self.base),
        )

    def rigid(self, lib: Library, pi: Array) -> Array:
        """Y π, (N, m)."""
        if self.base is not None:
            return np.asarray(self.base @ (lib.base_matrix @ pi))
        return lib.inverse_dynamics(self.q, self.dq, self.ddq, pi)

    def base_rigid(self, lib: Library, beta: Array) -> Array:
        """Y_b β, (N, m)."""
        if self.base is not None:
            return np.asarray(self.base @ beta)
        return lib.base_inverse_dynamics(self.q, self.dq, self.ddq, beta)

    def base_rows(self, lib: Library) -> Array:
        """Y_b, (N, m, n_b)."""
        return lib.base_regressor(self.q, self.dq, self.ddq) if self.base is None else self.base

    def friction(self, phi: Array) -> Array:
        """F φ, (N, m)."""
        own = friction.torque(self.columns, phi, self.coupling)
        return own.sum(axis=1, keepdims=True) if self._is_power else own

    def friction_rows(self) -> Array:
        """F as rows over [φ], (N, m, n k)."""
        rows = friction.spread(self.columns, self.coupling)
        return rows.sum(axis=1, keepdims=True) if self._is_power else rows

    @property
    def _is_power(self) -> bool:
        return self.equations < self.q.shape[1]


def samples_of(recording: Recording, lib: Library) -> Samples:
    """Check that a recording is complete, finite and of this robot.

    Raises:
        IdentificationError: something is missing, and the message says what to do.
    """
    n = lib.n_joints
    made = recording.rows is not None
    needed = ("dq", "tau") if made else ("dq", "ddq", "tau")
    missing = [key for key in needed if getattr(recording, key) is None]
    if missing:
        raise IdentificationError(
            f"identification needs q, dq, ddq and tau, the recording '{recording.name}' has no "
            f"{', '.join(missing)}; let preprocessing.prepare differentiate it"
        )
    if recording.q.shape[1] != n:
        raise IdentificationError(
            f"the recording '{recording.name}' has {recording.q.shape[1]} joints, the robot "
            f"'{lib.name}' has {n}: {', '.join(lib.joint_names)}"
        )
    columns = recording.columns
    if columns is None:
        columns = np.zeros((len(recording), n, 0))
    values = (recording.q, recording.dq, recording.ddq, recording.tau, columns, recording.rows)
    arrays = [None if a is None else np.ascontiguousarray(a, dtype=float) for a in values]
    if not all(a is None or np.isfinite(a).all() for a in arrays):
        raise IdentificationError(
            f"the recording '{recording.name}' holds NaN or infinite values; "
            "drop those rows before identifying"
        )
    q, dq, ddq, tau, columns, base = arrays
    assert q is not None and dq is not None and tau is not None  # noqa: S101, PT018  checked above
    assert columns is not None  # noqa: S101  just made
    coupling = friction.coupling_of(recording)
    if base is not None:
        ddq = None
        if base.shape[1] == 1:  # each column is scaled with the speed of what it belongs to
            tau, coupling = tau.sum(axis=1, keepdims=True), None
    return Samples(q, dq, ddq, tau, columns, coupling=coupling, base=base)


class TorqueObjective:
    """L(x) and ∇L(x) on given samples, whole or on a mini-batch of rows."""

    def __init__(
        self, lib: Library, samples: Samples, weights: Array, unit: Array | None = None
    ) -> None:
        self.lib, self.samples, self.weights = lib, samples, weights
        self.n_lam = lib.lam0.size
        self.shape = samples.columns.shape[1:]
        self.unit = friction_unit(samples) if unit is None else unit

    def split(self, x: Array) -> tuple[Array, Array]:
        """λ and φ (n, k) of x."""
        return x[: self.n_lam], x[self.n_lam :].reshape(self.shape) * self.unit

    def join(self, lam: Array, phi: Array) -> Array:
        """The unknowns x of λ and φ."""
        return np.concatenate([lam, (phi / self.unit).ravel()])

    def value_gradient(
        self, x: Array, rows: NDArray[np.int64] | None = None
    ) -> tuple[float, Array]:
        """L and ∇L over the given rows, all rows by default."""
        lam, phi = self.split(x)
        s, lib = self.samples, self.lib
        take = slice(None) if rows is None else rows
        q, dq, ddq, tau, columns = (a[take] for a in (s.q, s.dq, s.ddq, s.tau, s.columns))
        free = tau - friction.torque(columns, phi, s.coupling) if phi.size else tau
        pi = lib.pi_from_lam(lam)
        loss, slope, residual = lib.loss_gradient(q, dq, ddq, free, self.weights, pi)
        n_lam = lib.pi_adjoint(lam, slope)
        n_phi = _slope(columns, residual * self.weights, s.coupling) * self.unit
        return loss / len(q), np.concatenate([n_lam, n_phi.ravel()]) / len(q)

    def value(self, x: Array) -> float:
        """L over all rows."""
        lam, phi = self.split(x)
        s = self.samples
        residual = s.rigid(self.lib, self.lib.pi_from_lam(lam)) - s.tau
        if phi.size:
            residual = residual + s.friction(phi)
        return float(np.mean((residual**2) @ self.weights) / 2)


def _slope(columns: Array, weighted: Array, coupling: friction.Coupling | None) -> Array:
    """Σ_i Cᵀ W r of every coefficient, (n, k)."""
    if coupling is None:
        return np.asarray(np.einsum("ijk,ij->jk", columns, weighted))
    return np.asarray(np.einsum("ijk,ijk->jk", columns, coupling.to_columns(weighted)))


def friction_unit(samples: Samples) -> Array:
    """(n, k): RMS torque of the joint over RMS of the column; 1 for a silent column."""
    torque = np.sqrt(np.mean(samples.tau**2, axis=0) + THESIS_SIGMA**2)
    rms = np.sqrt(np.mean(samples.columns**2, axis=0))
    return torque[:, None] / np.where(rms > 0, rms, 1.0)
