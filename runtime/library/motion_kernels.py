"""Typed methods of the kernels of a motion: q, dq, ddq are (N, n) or (n,)."""

import numpy as np
from numpy.typing import ArrayLike

from runtime.library.binding import Array, Binding
from runtime.library.free_base import FREEDOM, BaseMotion, stacked, with_base
from runtime.library.manifest import Manifest


class MotionKernels:
    """Dynamics, regressors and bases of trajectories of one robot."""

    n_joints: int
    n_links: int
    manifest: Manifest
    base_matrix: Array
    _binding: Binding

    def inverse_dynamics(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        pi: ArrayLike,
        *,
        base: BaseMotion | None = None,
    ) -> Array:
        """Joint torques τ = Y(q, dq, ddq) π. Source: Eq. 4.3.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            Shape of q [N·m, N].
        """
        q, dq, ddq = with_base(self.manifest, base, q, dq, ddq)
        return self._binding.call("inverse_dynamics", q, dq, ddq, pi)[0]

    def base_inverse_dynamics(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        beta: ArrayLike,
        *,
        base: BaseMotion | None = None,
    ) -> Array:
        """Joint torques τ = Y_b(q, dq, ddq) β. Source: Eq. 3.11.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            beta: (n_b,) or (N, n_b) base parameters.
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            Shape of q [N·m, N].
        """
        q, dq, ddq = with_base(self.manifest, base, q, dq, ddq)
        return self._binding.call("base_inverse_dynamics", q, dq, ddq, beta)[0]

    def torque(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        lam: ArrayLike,
        *,
        base: BaseMotion | None = None,
    ) -> Array:
        """Joint torques τ = Y(q, dq, ddq) π(λ). Source: Eqs. 4.3, 4.14.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            lam: (10 L,) or (N, 10 L) coordinates λ of the links.
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            Shape of q [N·m, N].
        """
        q, dq, ddq = with_base(self.manifest, base, q, dq, ddq)
        return self._binding.call("torque", q, dq, ddq, lam)[0]

    def torque_jacobian(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        lam: ArrayLike,
        *,
        base: BaseMotion | None = None,
    ) -> Array:
        """Derivative ∂τ/∂λ. Source: Eqs. 4.34–4.36.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            lam: (10 L,) or (N, 10 L) coordinates λ of the links.
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            (N, n, 10 L).
        """
        q, dq, ddq = with_base(self.manifest, base, q, dq, ddq)
        return self._binding.call("torque_jacobian", q, dq, ddq, lam)[0]

    def regressor(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, *, base: BaseMotion | None = None
    ) -> Array:
        """Regressor Y with τ = Y π. Source: Eq. 3.1.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            (N, n, 10 L).
        """
        q, dq, ddq = with_base(self.manifest, base, q, dq, ddq)
        return self._binding.call("regressor", q, dq, ddq)[0]

    def base_regressor(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, *, base: BaseMotion | None = None
    ) -> Array:
        """Base regressor Y_b with τ = Y_b β. Source: Eq. 3.11.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            (N, n, n_b).
        """
        q, dq, ddq = with_base(self.manifest, base, q, dq, ddq)
        return self._binding.call("base_regressor", q, dq, ddq)[0]

    def mass_matrix(self, q: ArrayLike, pi: ArrayLike, *, base: BaseMotion | None = None) -> Array:
        """Mass matrix M(q). Source: Eq. 2.34.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            (N, n, n).
        """
        (q,) = with_base(self.manifest, base, q)
        return self._binding.call("mass_matrix", q, pi)[0]

    def bias_forces(
        self, q: ArrayLike, dq: ArrayLike, pi: ArrayLike, *, base: BaseMotion | None = None
    ) -> Array:
        """Bias forces h = τ(q, dq, 0). Source: Eq. 2.34.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            Shape of q [N·m, N].
        """
        q, dq = with_base(self.manifest, base, q, dq)
        return self._binding.call("bias_forces", q, dq, pi)[0]

    def forward_dynamics(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        tau: ArrayLike,
        pi: ArrayLike,
        rotor: ArrayLike = 0.0,
        *,
        base: BaseMotion | None = None,
    ) -> Array:
        """Accelerations ddq = (M + diag(J))⁻¹ (τ − h).

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            tau: joint torques, shape of q [N·m, N].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.
            rotor: J (N, n), (n,) or one number, inertia of the rotors [kg·m², kg].
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            Shape of q [rad/s², m/s²].
        """
        q, dq = with_base(self.manifest, base, q, dq)
        inertia = np.asarray(rotor, dtype=float)
        if inertia.ndim == 0:
            inertia = np.full(self.n_joints, inertia)
        if self.manifest.floating and inertia.shape[-1] == self.n_joints:
            inertia = stacked(inertia, np.zeros(FREEDOM), "rotors")
        return self._binding.call("forward_dynamics", q, dq, tau, pi, inertia)[0]

    def end_effector(self, q: ArrayLike, *, base: BaseMotion | None = None) -> Array:
        """Pose of the tip in the base frame; in that of the world with a free base.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            base: pose of a free base; None where it is fixed.

        Returns:
            (N, 4, 4).
        """
        (q,) = with_base(self.manifest, base, q)
        return self._binding.call("end_effector", q)[0]

    def link_poses(self, q: ArrayLike, *, base: BaseMotion | None = None) -> Array:
        """Poses of the links' frames in the base frame; in that of the world with a free base.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            base: pose of a free base; None where it is fixed.

        Returns:
            (N, L, 4, 4).
        """
        (q,) = with_base(self.manifest, base, q)
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
        *,
        base: BaseMotion | None = None,
    ) -> tuple[float, Array, Array]:
        """Loss Σ ½ rᵀ W r with r = Y π − τ, its gradient in π, and r. Source: Eqs. 4.5, 4.6, 4.32.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            tau: joint torques, shape of q [N·m, N].
            weight: (n,) diagonal of W.
            pi: (10 L,) inertial parameters of the links.
            base: pose, twist and acceleration of a free base; None where it is fixed.

        Returns:
            Loss; Σ Yᵀ W r, (10 L,); r, shape of q [N·m, N].
        """
        q, dq, ddq = with_base(self.manifest, base, q, dq, ddq)
        beta = np.asarray(pi, dtype=float) @ self.base_matrix.T
        answer = self._binding.call("loss_gradient", q, dq, ddq, tau, weight, beta)
        loss, gradient, residual = answer
        return float(loss[0]), gradient @ self.base_matrix, residual
