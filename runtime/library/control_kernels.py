"""Typed methods of the kernels of model-based controllers; q, dq are (N, n) or (n,)."""

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import LibraryError
from runtime.library.binding import Array, Binding
from runtime.library.free_base import BaseMotion, with_base
from runtime.library.manifest import Manifest


class ControlKernels:
    """Coriolis matrix, regressor of Slotine and Li, Jacobians of frames, bound of M⁻¹."""

    name: str
    n_joints: int
    n_links: int
    link_names: tuple[str, ...]
    manifest: Manifest
    _binding: Binding

    def coriolis_matrix(self, q: ArrayLike, dq: ArrayLike, pi: ArrayLike) -> Array:
        """Matrix C(q, dq) of Christoffel symbols: h = C dq − τ_grav, and dM/dt − 2 C is skew.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.

        Returns:
            (N, n, n).
        """
        return self._binding.call("coriolis_matrix", q, dq, pi)[0]

    def slotine_li_regressor(
        self, q: ArrayLike, dq: ArrayLike, dq_r: ArrayLike, ddq_r: ArrayLike
    ) -> Array:
        """Regressor Y with Y π = M(q) ddq_r + C(q, dq) dq_r + g(q). Source: Slotine & Li 1987.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            dq_r: reference velocities, shape of q [rad/s, m/s].
            ddq_r: reference accelerations, shape of q [rad/s², m/s²].

        Returns:
            (N, n, 10 L).
        """
        return self._binding.call("slotine_li_regressor", q, dq, dq_r, ddq_r)[0]

    def inverse_dynamics_derivatives(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, pi: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Derivatives ∂τ/∂q, ∂τ/∂dq and ∂τ/∂ddq = M(q), without the torque itself.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            dq: joint velocities, shape of q [rad/s, m/s].
            ddq: joint accelerations, shape of q [rad/s², m/s²].
            pi: (10 L,) or (N, 10 L) inertial parameters of the links.

        Returns:
            (N, n, n) each.
        """
        _, by_q, by_dq, mass = self._binding.call("torque_derivatives", q, dq, ddq, pi)
        return by_q, by_dq, mass

    def frame_jacobian(
        self, q: ArrayLike, link: str | None = None, *, base: BaseMotion | None = None
    ) -> Array:
        """Jacobian J of a frame: linear, then angular velocity J dq, in axes of the base.

        With a free base dq begins with its twist, and the axes are those of the world.

        Args:
            q: (N, n) or (n,) joint positions [rad, m].
            link: name of a moving link; None: the tip.
            base: pose of a free base; None where it is fixed.

        Returns:
            (N, 6, n) [m, 1].

        Raises:
            LibraryError: the robot has no moving link of that name.
        """
        if link not in (None, self.manifest.tip, *self.link_names):
            raise LibraryError(
                f"expected a moving link of '{self.name}' ({', '.join(self.link_names)}) or the "
                f"tip '{self.manifest.tip}', got '{link}'"
            )
        place = self.n_links if link not in self.link_names else self.link_names.index(link)
        (q,) = with_base(self.manifest, base, q)
        jacobians = self._binding.call("frame_jacobians", q)[0]
        return jacobians[..., 6 * place : 6 * (place + 1), :]

    def least_inertia(self, pi: ArrayLike, rotor: ArrayLike = 0.0) -> float:
        """Proven lower bound of the eigenvalues of M(q) + diag(J) at every q.

        M(q)⁻¹ ⪯ S for every q, S of the kernel `mobility_bound`; with coupled joints
        M = Aᵀ M_all A ⪰ Aᵀ S⁻¹ A, with closed loops M ⪰ S_qq⁻¹, the least over all rates of the
        dependent joints.

        Args:
            pi: (10 L,) inertial parameters of the links.
            rotor: J (n,) or one number, inertia of the rotors [kg·m², kg].

        Returns:
            Bound [kg·m², kg], above 0; NaN where the pseudo-inertia P of a link is not positive
            definite, so that nothing follows.
        """
        bodies = np.reshape(np.asarray(pi, dtype=float), (self.n_links, -1))
        pseudo = self._binding.call("pseudo_inertia", bodies)[0]
        if not (np.isfinite(bodies).all() and np.linalg.eigvalsh(pseudo).min() > 0):
            return float("nan")
        s = self._binding.call("mobility_bound", pi)[0]
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
