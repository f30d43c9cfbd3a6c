"""Typed methods of the kernels for limits of a motion: values and exact derivatives."""

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import LibraryError, ShapeError
from runtime.library.binding import Array, Binding
from runtime.library.manifest import Manifest


class SafetyKernels:
    """Torques and their rate, tip, distances.

    Args:
        q: (N, n) or (n,) joint positions [rad, m].
        dq: joint velocities, shape of q [rad/s, m/s].
        ddq: joint accelerations, shape of q [rad/s², m/s²].
        dddq: joint jerks, shape of q [rad/s³, m/s³].
        ddddq: fourth derivative of q, same shape [rad/s⁴, m/s⁴].
        pi: (10 n,) or (N, 10 n) inertial parameters of the links.
        seed: weight of each joint, shape of q.
        plane: (4,) = (n, d), |n| = 1, in the base frame; a table at height z is 0, 0, 1, z.
    """

    name: str
    n_joints: int
    manifest: Manifest
    binding: Binding

    def torque_derivatives(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, pi: ArrayLike
    ) -> tuple[Array, Array, Array, Array]:
        """Torques τ and their derivatives ∂τ/∂q, ∂τ/∂dq and ∂τ/∂ddq = M(q). Source: Eq. 4.3.

        Returns:
            τ, shape of q [N·m, N], and the derivatives, (N, n, n) each.
        """
        tau, dtau_dq, dtau_dv, dtau_da = self.binding.call("torque_derivatives", q, dq, ddq, pi)
        return tau, dtau_dq, dtau_dv, dtau_da

    def torque_rate(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, dddq: ArrayLike, pi: ArrayLike
    ) -> Array:
        """Torque rate dτ/dt = ∂τ/∂q dq + ∂τ/∂dq ddq + ∂τ/∂ddq dddq.

        Returns:
            Shape of q [N·m/s, N/s].
        """
        return self.binding.call("torque_rate", q, dq, ddq, dddq, pi)[0]

    def torque_with_rates(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        dddq: ArrayLike,
        ddddq: ArrayLike,
        pi: ArrayLike,
    ) -> tuple[Array, Array, Array]:
        """Torque τ, dτ/dt and d²τ/dt² along a motion.

        Returns:
            τ, dτ/dt and d²τ/dt², shape of q each.
        """
        tau, dtau, ddtau = self.binding.call("torque_course", q, dq, ddq, dddq, ddddq, pi)
        return tau, dtau, ddtau

    def torque_rate_adjoint(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        dddq: ArrayLike,
        pi: ArrayLike,
        seed: ArrayLike,
    ) -> Array:
        """Derivative ∂(seed · dτ/dt)/∂(q, dq, ddq, dddq): three times the work of `torque_rate`.

        Returns:
            (N, 4, n).
        """
        return self.binding.call("torque_rate_adjoint", q, dq, ddq, dddq, pi, seed)[0]

    def torque_rate_jacobian(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, dddq: ArrayLike, pi: ArrayLike
    ) -> tuple[Array, Array]:
        """Torque rate dτ/dt and its derivative by (q, dq, ddq, dddq) side by side.

        It takes n adjoints per sample; `torque_rate_adjoint` gives the rows of single joints.

        Returns:
            dτ/dt, shape of q [N·m/s, N/s], and its derivative, (N, n, 4 n).
        """
        rate = self.torque_rate(q, dq, ddq, dddq, pi)
        rows = []
        for unit in np.eye(self.n_joints):
            seed = np.broadcast_to(unit, rate.shape)
            rows.append(self.torque_rate_adjoint(q, dq, ddq, dddq, pi, seed))
        jacobian = np.stack(rows, axis=-3)
        return rate, jacobian.reshape(*rate.shape, 4 * self.n_joints)

    def tip_motion(self, q: ArrayLike, dq: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """Position p and velocity v of the tip in the base frame, with ∂p/∂q = ∂v/∂dq and ∂v/∂q.

        Returns:
            p and v, (N, 3) [m, m/s], and the two derivatives, (N, 3, n).
        """
        p, v, dp_dq, dv_dq = self.binding.call("tip_motion", q, dq)
        return p, v, dp_dq, dv_dq

    def clearance(self, q: ArrayLike) -> tuple[Array, Array]:
        """Surface distance of each of `pairs`, (N, n_pairs) [m], and its gradient (N, n_pairs, n).

        Negative where two capsules overlap. Margins are not subtracted.

        Raises:
            LibraryError: the robot has no pairs of proxies.
        """
        self._need("clearance")
        distance, jacobian = self.binding.call("clearance", q)
        return distance, jacobian

    def plane_clearance(self, q: ArrayLike, plane: ArrayLike) -> tuple[Array, Array]:
        """Least n·x − d over each of `moving_proxies`, (N, n_moving) [m], and its gradient.

        Returns:
            (N, n_moving) [m], and its gradient, (N, n_moving, n).

        Raises:
            LibraryError: the robot has no moving proxies.
            ShapeError: the plane is not four finite numbers with a unit normal.
        """
        self._need("plane_clearance")
        given = np.asarray(plane, dtype=float)
        # A normal off by 1e-6 makes a height off by 1 µm per metre.
        unit = given.shape == (4,) and abs(np.linalg.norm(given[:3]) - 1) < 1e-6
        if not (unit and np.isfinite(given).all()):
            raise ShapeError(
                f"plane needs a unit normal and an offset, (4,), got {np.array2string(given)}"
            )
        distance, jacobian = self.binding.call("plane_clearance", q, given)
        return distance, jacobian

    def _need(self, kernel: str) -> None:
        if kernel not in self.manifest.kernels and kernel not in self.manifest.omitted:
            raise LibraryError(
                f"'{self.name}' has no collision proxies; fit them with: python -m symgen proxies "
                "URDF --out X.toml, and build with --config X.toml"
            )


class ProofKernels:
    """Suprema over K intervals from those of the joints; units are those of SI.

    Args:
        motion: bounds of |q| and its first derivatives in time, (K, orders, n).
        pi: (10 L,) inertial parameters of the links.
    """

    manifest: Manifest
    binding: Binding

    @property
    def bounds_motions(self) -> bool:
        """Whether the robot has these kernels; robots with closed loops have none."""
        return "torque_bounds" in self.manifest.kernels

    def torque_bounds(self, motion: ArrayLike, pi: ArrayLike) -> Array:
        """Bounds of |τ|, |dτ/dt|, |d²τ/dt²| and |d³τ/dt³| from six orders of the motion.

        Returns:
            (K, 4, n) [N·m, N, and per s …].
        """
        return self.binding.call("torque_bounds", motion, pi)[0]

    def tip_bounds(self, motion: ArrayLike) -> Array:
        """Bounds of the tip's distance from the base and of three derivatives, from four orders.

        Returns:
            (K, 4) [m, m/s, m/s², m/s³].
        """
        return self.binding.call("tip_bounds", motion)[0]

    def speed_bounds(self, motion: ArrayLike) -> tuple[Array, Array]:
        """Bounds of the speed that joint j gives to link i: its origin, and turning about it.

        A point of the link at a distance r from its origin gets origin + r · turn at most. The
        motion has two orders, |q| and |dq|.

        Returns:
            (K, L, L) [m/s], 0 where joint j does not move link i, and (K, L) [rad/s].
        """
        origin, turn = self.binding.call("speed_bounds", motion)
        return origin, turn
