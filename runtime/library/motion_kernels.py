"""Typed methods of the kernels of a motion: q, dq, ddq are (N, n) or (n,)."""

import numpy as np
from numpy.typing import ArrayLike

from runtime.library.binding import Array, Binding


class MotionKernels:
    """Dynamics, regressors and bases of trajectories of one robot."""

    n_joints: int
    base_matrix: Array
    _binding: Binding

    def inverse_dynamics(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, pi: ArrayLike) -> Array:
        """τ = Y(q, dq, ddq) π, (N, n) [N·m or N]. Source: Eq. 4.3."""
        return self._binding.call("inverse_dynamics", q, dq, ddq, pi)[0]

    def base_inverse_dynamics(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, beta: ArrayLike
    ) -> Array:
        """τ = Y_b(q, dq, ddq) β, (N, n) [N·m or N]. Source: Eq. 3.11."""
        return self._binding.call("base_inverse_dynamics", q, dq, ddq, beta)[0]

    def torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, lam: ArrayLike) -> Array:
        """τ = Y(q, dq, ddq) π(λ), (N, n). Source: Eqs. 4.3, 4.14."""
        return self._binding.call("torque", q, dq, ddq, lam)[0]

    def torque_jacobian(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, lam: ArrayLike) -> Array:
        """∂τ/∂λ, (N, n, 10 n). Source: Eqs. 4.34–4.36."""
        return self._binding.call("torque_jacobian", q, dq, ddq, lam)[0]

    def regressor(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Y with τ = Y π, (N, n, 10 n). Source: Eq. 3.1."""
        return self._binding.call("regressor", q, dq, ddq)[0]

    def base_regressor(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Y_b with τ = Y_b β, (N, n, n_b). Source: Eq. 3.11."""
        return self._binding.call("base_regressor", q, dq, ddq)[0]

    def momentum_regressor(self, q: ArrayLike, dq: ArrayLike) -> tuple[Array, Array]:
        """P_b and R_b with p = M dq = P_b β, ∂(T − U)/∂q = R_b β and τ = dp/dt − R_b β,
        (N, n, n_b) each. Source: Slotine & Li 1987.
        """
        momentum, force = self._binding.call("momentum_regressor", q, dq)
        return momentum, force

    def energy_regressor(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """E_b with T + U = E_b β but for a constant, (N, n_b). Source: Gautier & Khalil 1988."""
        return self._binding.call("energy_regressor", q, dq)[0]

    def mass_matrix(self, q: ArrayLike, pi: ArrayLike) -> Array:
        """M(q), (N, n, n). Source: Eq. 2.34."""
        return self._binding.call("mass_matrix", q, pi)[0]

    def bias_forces(self, q: ArrayLike, dq: ArrayLike, pi: ArrayLike) -> Array:
        """h = τ(q, dq, 0), (N, n). Source: Eq. 2.34."""
        return self._binding.call("bias_forces", q, dq, pi)[0]

    def forward_dynamics(
        self, q: ArrayLike, dq: ArrayLike, tau: ArrayLike, pi: ArrayLike, rotor: ArrayLike = 0.0
    ) -> Array:
        """ddq = (M + diag(J))⁻¹ (τ − h), (N, n); J (N, n), (n,) or one number: of the rotors."""
        inertia = np.asarray(rotor, dtype=float)
        if inertia.ndim == 0:
            inertia = np.full(self.n_joints, inertia)
        return self._binding.call("forward_dynamics", q, dq, tau, pi, inertia)[0]

    def end_effector(self, q: ArrayLike) -> Array:
        """Pose of the tip in the base frame, (N, 4, 4)."""
        return self._binding.call("end_effector", q)[0]

    def link_poses(self, q: ArrayLike) -> Array:
        """Poses of the links' frames in the base frame, (N, n, 4, 4)."""
        poses = self._binding.call("link_poses", q)[0]
        return poses.reshape(*np.shape(q), 4, 4)

    def loss_gradient(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        tau: ArrayLike,
        weight: ArrayLike,
        pi: ArrayLike,
    ) -> tuple[float, Array, Array]:
        """Σ ½ rᵀWr, Σ YᵀWr (10 n,) and r = Yπ − τ (N, n) over the batch; W = diag(weight).

        Source: Eqs. 4.5, 4.6, 4.32.
        """
        beta = np.asarray(pi, dtype=float) @ self.base_matrix.T
        answer = self._binding.call("loss_gradient", q, dq, ddq, tau, weight, beta)
        loss, gradient, residual = answer
        return float(loss[0]), gradient @ self.base_matrix, residual

    def regressor_adjoint(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, seed: ArrayLike
    ) -> Array:
        """∂⟨seed, Y_b⟩/∂(q, dq, ddq), (N, 3, n), from seed (N, n, n_b)."""
        return self._binding.call("regressor_adjoint", q, dq, ddq, seed)[0]

    # --- trajectories: one row per point ----------------------------------------------------

    def harmonic_basis(self, m: ArrayLike, t: ArrayLike, t_f: float) -> Array:
        """φ_m(t) of the Fourier + quintic basis and three derivatives, (N, 4). Eqs. 3.24–3.27."""
        orders, times = np.broadcast_arrays(np.atleast_1d(m), np.atleast_1d(t))
        return self._binding.call("harmonic_basis", _column(orders), _column(times), t_f)[0]

    def transfer_basis(self, t: ArrayLike, t_f: float) -> Array:
        """S(t), the rest-to-rest quintic from 0 to 1, and three derivatives, (N, 4)."""
        return self._binding.call("transfer_basis", _column(t), t_f)[0]


def _column(value: ArrayLike) -> Array:
    return np.reshape(np.asarray(value, dtype=float), (-1, 1))
