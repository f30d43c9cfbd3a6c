"""Recording + library → the weighted torque loss and its gradient.

L(λ, φ) = (1/N) Σ ½ rᵀ W r,  r = Y π(λ) + F φ − τ (Eqs. 4.5, 4.6), with friction F φ as an option.
The unknowns are x = [λ, ψ]: φ = ψ · unit, where one unit of ψ moves the torque of its joint by as
much as a relative change of one in λ does, so that one step size serves both.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from runtime.errors import IdentificationError, NeedsError
from runtime.library import Array, Library
from runtime.recording import Recording, friction

THESIS_SIGMA = 0.5
"""Regularisation of Eq. 4.8, N·m."""


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
                "'acceleration', or a method that works on compressed statistics, such as map"
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
