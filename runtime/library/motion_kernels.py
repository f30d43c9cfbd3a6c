"""Typed methods of the kernels of a motion: q, dq, ddq are (N, n) or (n,)."""

import numpy as np
from numpy.typing import ArrayLike

from runtime.library.binding import Array, Binding
from runtime.library.manifest import Manifest


class MotionKernels:
    """Dynamics, regressors and bases of trajectories of one robot."""

    n_joints: int
    n_links: int
    manifest: Manifest
    base_matrix: Array
    _binding: Binding

    def inverse_dynamics(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, pi: ArrayLike) -> Array:
        """Joint torques τ = Y(q, dq, ddq) π. Source: Eq. 4.3.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.

        Returns:
            Shape of q [N·m, N].
        """
        return self._binding.call("inverse_dynamics", q, dq, ddq, pi)[0]

    def base_inverse_dynamics(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, beta: ArrayLike
    ) -> Array:
        """Joint torques τ = Y_b(q, dq, ddq) β. Source: Eq. 3.11.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            beta: (n_b,) or (N, n_b) base parameters.

        Returns:
            Shape of q [N·m, N].
        """
        return self._binding.call("base_inverse_dynamics", q, dq, ddq, beta)[0]

    def torque(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, lam: ArrayLike) -> Array:
        """Joint torques τ = Y(q, dq, ddq) π(λ). Source: Eqs. 4.3, 4.14.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            lam: (10 L,) or (N, 10 L) coordinates λ of the links.

        Returns:
            Shape of q [N·m, N].
        """
        return self._binding.call("torque", q, dq, ddq, lam)[0]

    def torque_jacobian(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, lam: ArrayLike) -> Array:
        """Derivative ∂τ/∂λ. Source: Eqs. 4.34–4.36.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            lam: (10 L,) or (N, 10 L) coordinates λ of the links.

        Returns:
            (N, n, 10 L).
        """
        return self._binding.call("torque_jacobian", q, dq, ddq, lam)[0]

    def regressor(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Regressor Y with τ = Y π. Source: Eq. 3.1.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].

        Returns:
            (N, n, 10 L).
        """
        return self._binding.call("regressor", q, dq, ddq)[0]

    def base_regressor(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Base regressor Y_b with τ = Y_b β. Source: Eq. 3.11.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].

        Returns:
            (N, n, n_b).
        """
        return self._binding.call("base_regressor", q, dq, ddq)[0]

    def momentum_regressor(self, q: ArrayLike, dq: ArrayLike) -> tuple[Array, Array]:
        """Regressors of the momentum p = M dq = P_b β and of ∂(T − U)/∂q = R_b β, τ = dp/dt − R_b
        β.

        Source: Slotine & Li 1987.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].

        Returns:
            P_b and R_b, (N, n, n_b) each.
        """
        momentum, force = self._binding.call("momentum_regressor", q, dq)
        return momentum, force

    def energy_regressor(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Regressor E_b of the energy T + U = E_b β + const. Source: Gautier & Khalil 1988.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].

        Returns:
            (N, n_b).
        """
        return self._binding.call("energy_regressor", q, dq)[0]

    def spring_columns(self, q: ArrayLike) -> Array:
        """Torques S(q) of the springs of unknown stiffness for k = 1, τ = S k.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].

        Returns:
            (N, n, s) for the s springs of `manifest.springs`; s = 0 without springs.
        """
        if "spring_columns" not in self.manifest.kernels:
            return np.zeros((*np.shape(q), 0))
        return self._binding.call("spring_columns", q)[0]

    def known_torque(self, q: ArrayLike) -> Array:
        """Torques of torque curves and of springs of known stiffness, which Y π lacks.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].

        Returns:
            Shape of q [N·m, N]; zeros without such.
        """
        if "known_torque" not in self.manifest.kernels:
            return np.zeros(np.shape(q))
        return self._binding.call("known_torque", q)[0]

    def mass_matrix(self, q: ArrayLike, pi: ArrayLike) -> Array:
        """Mass matrix M(q). Source: Eq. 2.34.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.

        Returns:
            (N, n, n).
        """
        return self._binding.call("mass_matrix", q, pi)[0]

    def bias_forces(self, q: ArrayLike, dq: ArrayLike, pi: ArrayLike) -> Array:
        """Bias forces h = τ(q, dq, 0). Source: Eq. 2.34.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.

        Returns:
            Shape of q [N·m, N].
        """
        return self._binding.call("bias_forces", q, dq, pi)[0]

    def forward_dynamics(
        self, q: ArrayLike, dq: ArrayLike, tau: ArrayLike, pi: ArrayLike, rotor: ArrayLike = 0.0
    ) -> Array:
        """Accelerations ddq = (M + diag(J))⁻¹ (τ − h).

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            tau: joint torques, shape of q [N·m, N].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.
            rotor: J (N, n), (n,) or one number, inertia of the rotors [kg·m², kg].

        Returns:
            Shape of q [rad/s², m/s²].
        """
        inertia = np.asarray(rotor, dtype=float)
        if inertia.ndim == 0:
            inertia = np.full(self.n_joints, inertia)
        return self._binding.call("forward_dynamics", q, dq, tau, pi, inertia)[0]

    def end_effector(self, q: ArrayLike) -> Array:
        """Pose of the tip in the base frame, (N, 4, 4)."""
        return self._binding.call("end_effector", q)[0]

    def link_poses(self, q: ArrayLike) -> Array:
        """Poses of the links' frames in the base frame, (N, L, 4, 4)."""
        poses = self._binding.call("link_poses", q)[0]
        return poses.reshape(*np.shape(q)[:-1], self.n_links, 4, 4)

    def loss_gradient(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        tau: ArrayLike,
        weight: ArrayLike,
        pi: ArrayLike,
    ) -> tuple[float, Array, Array]:
        """Loss Σ ½ rᵀ W r with r = Y π − τ, its gradient in π, and r. Source: Eqs. 4.5, 4.6, 4.32.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            tau: joint torques, shape of q [N·m, N].
            weight: (n,) diagonal of W.
            pi: (10 L,) inertial parameters of the links.

        Returns:
            Loss; Σ Yᵀ W r, (10 L,); r, shape of q [N·m, N].
        """
        beta = np.asarray(pi, dtype=float) @ self.base_matrix.T
        answer = self._binding.call("loss_gradient", q, dq, ddq, tau, weight, beta)
        loss, gradient, residual = answer
        return float(loss[0]), gradient @ self.base_matrix, residual

    def regressor_adjoint(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, seed: ArrayLike
    ) -> Array:
        """Derivative ∂⟨seed, Y_b⟩/∂(q, dq, ddq).

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            seed: (N, n, n_b).

        Returns:
            (N, 3, n).
        """
        return self._binding.call("regressor_adjoint", q, dq, ddq, seed)[0]

    # --- trajectories: one row per point ----------------------------------------------------

    def harmonic_basis(self, m: ArrayLike, t: ArrayLike, t_f: float) -> Array:
        """Fourier + quintic basis φ_m(t) and three derivatives. Source: Eqs. 3.24–3.27.

        Args:
            m: harmonic, one number or (N,).
            t: times, one number or (N,) [s].
            t_f: duration [s].

        Returns:
            (N, 4).
        """
        orders, times = np.broadcast_arrays(np.atleast_1d(m), np.atleast_1d(t))
        return self._binding.call("harmonic_basis", _column(orders), _column(times), t_f)[0]

    def transfer_basis(self, t: ArrayLike, t_f: float) -> Array:
        """Rest-to-rest quintic S(t) from 0 to 1, and three derivatives.

        Args:
            t: times, one number or (N,) [s].
            t_f: duration [s].

        Returns:
            (N, 4).
        """
        return self._binding.call("transfer_basis", _column(t), t_f)[0]


def _column(value: ArrayLike) -> Array:
    return np.reshape(np.asarray(value, dtype=float), (-1, 1))
