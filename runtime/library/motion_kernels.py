"""Typed methods of the kernels of a motion: q, dq, ddq are (N, n) or (n,).

Momentum, energy, springs and trajectories are those of robots with a fixed base; the library of one
with a free base answers with the name of what to use instead.
"""

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import LibraryError
from runtime.library.arrays import Array
from runtime.library.free_base import FREEDOM, BaseMotion, stacked, with_base
from runtime.library.joint_kernels import Kernels

Base = BaseMotion | None


class MotionKernels(Kernels):
    """Dynamics, regressors, equations of controllers and bases of trajectories of one robot.

    Args:
        q: (N, n) or (n,) joint positions [rad, m].
        dq: joint velocities, shape of q [rad/s, m/s].
        ddq: joint accelerations, shape of q [rad/s², m/s²].
        tau: joint torques, shape of q [N·m, N].
        pi: (10 L,) or (N, 10 L) inertial parameters of the links.
        lam: (10 L,) or (N, 10 L) coordinates λ of the links.
        beta: (n_b,) or (N, n_b) base parameters.
        rotor: J (N, n), (n,) or one number, inertia of the rotors [kg·m², kg].
        weight: (n,) diagonal of W.
        seed: weights (N, n, n_b) of the entries of Y_b.
        dq_r: reference velocities, shape of q [rad/s, m/s].
        ddq_r: reference accelerations, shape of q [rad/s², m/s²].
        link: name of a moving link; None: the tip.
        base: pose, twist and acceleration of a free base; None where it is fixed.
        m: harmonic, one number or (N,).
        t: times, one number or (N,) [s].
        t_f: duration [s].
    """

    def inverse_dynamics(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, pi: ArrayLike, *, base: Base = None
    ) -> Array:
        """Joint torques τ = Y(q, dq, ddq) π, shape of q [N·m, N]. Source: Eq. 4.3."""
        return self._call("inverse_dynamics", base, (q, dq, ddq), pi)[0]

    def base_inverse_dynamics(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, beta: ArrayLike, *, base: Base = None
    ) -> Array:
        """Joint torques τ = Y_b(q, dq, ddq) β, shape of q [N·m, N]. Source: Eq. 3.11."""
        return self._call("base_inverse_dynamics", base, (q, dq, ddq), beta)[0]

    def torque(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, lam: ArrayLike, *, base: Base = None
    ) -> Array:
        """Joint torques τ = Y(q, dq, ddq) π(λ), shape of q [N·m, N]. Source: Eqs. 4.3, 4.14."""
        return self._call("torque", base, (q, dq, ddq), lam)[0]

    def torque_jacobian(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, lam: ArrayLike, *, base: Base = None
    ) -> Array:
        """Derivative ∂τ/∂λ, (N, n, 10 L). Source: Eqs. 4.34–4.36."""
        return self._call("torque_jacobian", base, (q, dq, ddq), lam)[0]

    def regressor(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, *, base: Base = None) -> Array:
        """Regressor Y with τ = Y π, (N, n, 10 L). Source: Eq. 3.1."""
        return self._call("regressor", base, (q, dq, ddq))[0]

    def base_regressor(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, *, base: Base = None
    ) -> Array:
        """Base regressor Y_b with τ = Y_b β, (N, n, n_b). Source: Eq. 3.11."""
        return self._call("base_regressor", base, (q, dq, ddq))[0]

    def mass_matrix(self, q: ArrayLike, pi: ArrayLike, *, base: Base = None) -> Array:
        """Mass matrix M(q), (N, n, n). Source: Eq. 2.34."""
        return self._call("mass_matrix", base, (q,), pi)[0]

    def bias_forces(
        self, q: ArrayLike, dq: ArrayLike, pi: ArrayLike, *, base: Base = None
    ) -> Array:
        """Bias forces h = τ(q, dq, 0), shape of q [N·m, N]. Source: Eq. 2.34."""
        return self._call("bias_forces", base, (q, dq), pi)[0]

    def forward_dynamics(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        tau: ArrayLike,
        pi: ArrayLike,
        rotor: ArrayLike = 0.0,
        *,
        base: Base = None,
    ) -> Array:
        """Accelerations ddq = (M + diag(J))⁻¹ (τ − h), shape of q [rad/s², m/s²]."""
        inertia = np.asarray(rotor, dtype=float)
        if inertia.ndim == 0:
            inertia = np.full(self.n_joints, inertia)
        if self.manifest.floating and inertia.shape[-1] == self.n_joints:
            inertia = stacked(inertia, np.zeros(FREEDOM), "rotors")
        return self._call("forward_dynamics", base, (q, dq), tau, pi, inertia)[0]

    def end_effector(self, q: ArrayLike, *, base: Base = None) -> Array:
        """Pose (N, 4, 4) of the tip in the base frame; in that of the world with a free base."""
        return self._call("end_effector", base, (q,))[0]

    def link_poses(self, q: ArrayLike, *, base: Base = None) -> Array:
        """Poses (N, L, 4, 4) of the links' frames in the base frame; in the world if it is free."""
        poses = self._call("link_poses", base, (q,))[0]
        return poses.reshape(*poses.shape[:-2], self.n_links, 4, 4)

    def loss_gradient(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        tau: ArrayLike,
        weight: ArrayLike,
        pi: ArrayLike,
        *,
        base: Base = None,
    ) -> tuple[float, Array, Array]:
        """Loss Σ ½ rᵀ W r, Σ Yᵀ W r (10 L,), r = Y π − τ (N, n). Source: Eqs. 4.5, 4.6, 4.32."""
        beta = np.asarray(pi, dtype=float) @ self.base_matrix.T
        answer = self._call("loss_gradient", base, (q, dq, ddq), tau, weight, beta)
        loss, gradient, residual = answer
        return float(loss[0]), gradient @ self.base_matrix, residual

    def _call(
        self, name: str, base: Base, motion: tuple[ArrayLike, ...], *values: ArrayLike
    ) -> tuple[Array, ...]:
        """All outputs of a kernel that takes the motion of the base too where it is free."""
        return self.binding.call(name, *with_base(self.manifest, base, *motion), *values)

    # --- model-based controllers ----------------------------------------------------------

    def coriolis_matrix(self, q: ArrayLike, dq: ArrayLike, pi: ArrayLike) -> Array:
        """C of Christoffel symbols, (N, n, n): h = C dq − τ_grav, and dM/dt − 2 C is skew."""
        return self.binding.call("coriolis_matrix", q, dq, pi)[0]

    def slotine_li_regressor(
        self, q: ArrayLike, dq: ArrayLike, dq_r: ArrayLike, ddq_r: ArrayLike
    ) -> Array:
        """Y, (N, n, 10 L): Y π = M(q) ddq_r + C(q, dq) dq_r + g(q). Source: Slotine & Li 1987."""
        return self.binding.call("slotine_li_regressor", q, dq, dq_r, ddq_r)[0]

    def inverse_dynamics_derivatives(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, pi: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Derivatives ∂τ/∂q, ∂τ/∂dq and ∂τ/∂ddq = M(q), (N, n, n) each, without the torque."""
        _, by_q, by_dq, mass = self.binding.call("torque_derivatives", q, dq, ddq, pi)
        return by_q, by_dq, mass

    def frame_jacobian(self, q: ArrayLike, link: str | None = None, *, base: Base = None) -> Array:
        """J (N, 6, n) [m, 1] of a frame: linear, then angular velocity J dq, in axes of the base.

        With a free base dq begins with its twist, and the axes are those of the world.

        Raises:
            LibraryError: the robot has no moving link of that name.
        """
        if link not in (None, self.manifest.tip, *self.link_names):
            raise LibraryError(
                f"expected a moving link of '{self.name}' ({', '.join(self.link_names)}) or the "
                f"tip '{self.manifest.tip}', got '{link}'"
            )
        place = self.n_links if link not in self.link_names else self.link_names.index(link)
        return self._call("frame_jacobians", base, (q,))[0][..., 6 * place : 6 * (place + 1), :]

    def least_inertia(self, pi: ArrayLike, rotor: ArrayLike = 0.0) -> float:
        """Proven lower bound of the eigenvalues of M(q) + diag(J) at every q.

        M(q)⁻¹ ⪯ S for every q, S of the kernel `mobility_bound`; with coupled joints
        M = Aᵀ M_all A ⪰ Aᵀ S⁻¹ A, with closed loops M ⪰ S_qq⁻¹, the least over all rates of the
        dependent joints.

        Returns:
            Bound [kg·m², kg], above 0; NaN where the pseudo-inertia P of a link is not positive
            definite, so that nothing follows.
        """
        bodies = np.reshape(np.asarray(pi, dtype=float), (self.n_links, -1))
        pseudo = self.binding.call("pseudo_inertia", bodies)[0]
        if not (np.isfinite(bodies).all() and np.linalg.eigvalsh(pseudo).min() > 0):
            return float("nan")
        s = self.binding.call("mobility_bound", pi)[0]
        coupling = self.manifest.coupling
        rotors = np.broadcast_to(np.asarray(rotor, dtype=float), self.n_joints)
        if self.manifest.loops:
            names = [joint.name for joint in self.manifest.all_joints]
            places = [names.index(joint.name) for joint in self.manifest.joints]
            below = np.linalg.inv(s[np.ix_(places, places)])
        else:
            matrix = np.eye(self.n_links) if coupling is None else np.asarray(coupling.matrix)
            below = matrix.T @ np.linalg.solve(s, matrix)
        below = below + np.diag(rotors)
        return float(np.linalg.eigvalsh((below + below.T) / 2)[0])

    # --- robots with a fixed base ---------------------------------------------------------

    def momentum_regressor(self, q: ArrayLike, dq: ArrayLike) -> tuple[Array, Array]:
        """P_b and R_b, (N, n, n_b) each: momentum M dq = P_b β, ∂(T − U)/∂q = R_b β.

        τ = dp/dt − R_b β. Source: Slotine & Li 1987.
        """
        momentum, force = self.binding.call("momentum_regressor", q, dq)
        return momentum, force

    def energy_regressor(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """E_b of the energy T + U = E_b β + const, (N, n_b). Source: Gautier & Khalil 1988."""
        return self.binding.call("energy_regressor", q, dq)[0]

    def spring_columns(self, q: ArrayLike) -> Array:
        """Torques S(q) of the s springs of unknown stiffness for k = 1, τ = S k, (N, n, s)."""
        if "spring_columns" not in self.manifest.kernels:
            return np.zeros((*np.shape(q), 0))
        return self.binding.call("spring_columns", q)[0]

    def known_torque(self, q: ArrayLike) -> Array:
        """Torques of torque curves and of springs of known stiffness, which Y π lacks, or zeros."""
        if "known_torque" not in self.manifest.kernels:
            return np.zeros(np.shape(q))
        return self.binding.call("known_torque", q)[0]

    def regressor_adjoint(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, seed: ArrayLike
    ) -> Array:
        """Derivative ∂⟨seed, Y_b⟩/∂(q, dq, ddq), (N, 3, n)."""
        return self.binding.call("regressor_adjoint", q, dq, ddq, seed)[0]

    # --- trajectories: one row per point ----------------------------------------------------

    def harmonic_basis(self, m: ArrayLike, t: ArrayLike, t_f: float) -> Array:
        """Fourier + quintic basis φ_m(t) and three derivatives, (N, 4). Source: Eqs. 3.24–3.27."""
        orders, times = np.broadcast_arrays(np.atleast_1d(m), np.atleast_1d(t))
        return self.binding.call("harmonic_basis", _column(orders), _column(times), t_f)[0]

    def transfer_basis(self, t: ArrayLike, t_f: float) -> Array:
        """Rest-to-rest quintic S(t) from 0 to 1, and three derivatives, (N, 4)."""
        return self.binding.call("transfer_basis", _column(t), t_f)[0]


def _column(value: ArrayLike) -> Array:
    return np.reshape(np.asarray(value, dtype=float), (-1, 1))
