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
from runtime.recording.prepared import DifferentiatedRecording, prepared_of

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
    data = prepared_of(recording)
    if data.q.shape[1] != n:
        raise IdentificationError(
            f"the recording '{recording.name}' has {recording.q.shape[1]} joints, the robot "
            f"'{lib.name}' has {n}: {', '.join(lib.joint_names)}"
        )
    coupling = friction.coupling_of(recording)
    if isinstance(data, DifferentiatedRecording):
        return Samples(data.q, data.dq, data.ddq, data.tau, data.columns, coupling=coupling)
    tau = data.tau
    if data.rows.shape[1] == 1:  # each column is scaled with the speed of what it belongs to
        tau, coupling = tau.sum(axis=1, keepdims=True), None
    return Samples(data.q, data.dq, None, tau, data.columns, coupling=coupling, base=data.rows)
