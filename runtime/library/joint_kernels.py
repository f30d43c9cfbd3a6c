"""Motion of all joints from that of the independent ones, maps of bodies, limits and proofs.

q_all = A q + b, or closed loops φ(q, d) = 0 by Newton in C from the assembly pose, with NaN at
singular postures, which are refused here by the name of the loop. π and λ are (10 L,) or (N, 10 L).
Kernels for limits of a motion give values and exact derivatives.
"""

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import LibraryError, NotRealisableError, PostureError, ShapeError
from runtime.library.arrays import Array
from runtime.library.binding import Binding
from runtime.library.manifest import Manifest
from runtime.library.parameters import N_PARAMETERS


class Kernels:
    """What the methods of kernels read of a library."""

    name: str
    n_joints: int
    n_links: int
    joint_names: tuple[str, ...]
    link_names: tuple[str, ...]
    base_matrix: Array
    manifest: Manifest
    binding: Binding


class JointKernels(Kernels):
    """Positions, velocities and Jacobian of all joints, (N, L) or (L,) [rad, m, and per s].

    Args:
        q: (N, n) or (n,) positions of the independent joints [rad, m].
        dq: their velocities, shape of q [rad/s, m/s].
        ddq: their accelerations, shape of q [rad/s², m/s²].
        last: (N, L) or (L,) positions of all joints a sample before [rad, m].

    Raises:
        ShapeError: an array has another number of joints.
        PostureError: a loop cannot close at q, or is singular there.
    """

    def all_positions(self, q: ArrayLike) -> Array:
        """Positions of all joints, ordered as `all_joint_names`: A q + b, or g(q) with loops."""
        coupling, q = self.manifest.coupling, self._of_joints(q)
        if not self.manifest.loops:
            return q.copy() if coupling is None else q @ coupling.matrix.T + coupling.offset
        self.require_closed(q)
        zero = np.zeros(self.n_joints)
        return self.binding.call("all_joints", q, zero, zero)[0]

    def all_velocities(self, dq: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Velocities of all joints: A dq, or G(q) dq with loops, (N, L) or (L,) [rad/s, m/s]."""
        coupling, dq = self.manifest.coupling, self._of_joints(dq)
        if not self.manifest.loops:
            return dq.copy() if coupling is None else dq @ coupling.matrix.T
        if q is None:
            raise ShapeError(
                f"the velocities of all joints of '{self.name}' depend on its loops' posture; call "
                "all_velocities(dq, q)"
            )
        return self.all_motion(q, dq, 0 * dq)[1]

    def all_motion(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations of all joints, (N, L) or (L,) each."""
        if not self.manifest.loops:
            return self.all_positions(q), self.all_velocities(dq), self.all_velocities(ddq)
        self.require_closed(q)
        return self.motion_or_nan(q, dq, ddq)

    def motion_or_nan(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Motion of all joints as `all_motion`, (N, L) or (L,), NaN where a loop cannot close."""
        if not self.manifest.loops:
            return self.all_motion(q, dq, ddq)
        motion = (self._of_joints(values) for values in (q, dq, ddq))
        positions, velocities, accelerations = self.binding.call("all_joints", *motion)
        return positions, velocities, accelerations

    def next_positions(self, q: ArrayLike, last: ArrayLike) -> Array:
        """Positions of all joints from those of a sample shortly before, for a control loop.

        Shape of last; NaN where a loop cannot close or is singular; A q + b without loops.
        """
        if not self.manifest.loops:
            return self.all_positions(q)
        return self.binding.call("next_positions", q, last)[0]

    def joint_jacobian(self, q: ArrayLike) -> Array:
        """G = ∂q_all/∂q, (N, L, n) or (L, n): τ = Gᵀ τ_all."""
        q, coupling = self._of_joints(q), self.manifest.coupling
        if not self.manifest.loops:
            matrix = np.eye(self.n_joints) if coupling is None else coupling.matrix
            return np.broadcast_to(matrix, (*q.shape[:-1], *matrix.shape)).copy()
        self.require_closed(q)
        return self.binding.call("joint_jacobian", q)[0]

    def loop_margins(self, q: ArrayLike) -> Array:
        """Distance of each loop from a singular posture: 1 in the assembly pose, 0 where singular.

        (N, blocks) or (blocks,), NaN where a loop cannot close; no columns without loops.
        """
        q = self._of_joints(q)
        if not self.manifest.loops:
            return np.zeros((*q.shape[:-1], 0))
        return self.binding.call("joint_jacobian", q)[1]

    def require_closed(self, q: ArrayLike) -> None:
        """Check that all loops close and are not singular at finite positions.

        Raises:
            PostureError: the message names the loops, the first position and the number of such.
        """
        rows = np.atleast_2d(self._of_joints(q))
        if not self.manifest.loops or not len(rows):
            return
        bad = np.isnan(self.loop_margins(rows)).any(axis=1) & np.isfinite(rows).all(axis=1)
        if bad.any():
            first = int(np.argmax(bad))
            values = zip(self.joint_names, rows[first], strict=True)
            at = ", ".join(f"{name} = {value:.4g}" for name, value in values)
            raise PostureError(
                f"{bad.sum()} of {len(rows)} positions of '{self.name}' (the first at row {first}: "
                f"{at}) are beyond a singular posture of {', '.join(self.manifest.loops)}, or the "
                "loop cannot close there; check units, signs and zeros of the positions, or leave "
                f"these rows out{self._within_a_turn(rows[first])}"
            )

    def _within_a_turn(self, row: Array) -> str:
        """Remedy where the loops close at positions less whole turns; empty where they do not."""
        home = np.asarray(self.manifest.home, dtype=float)
        turns = np.array([joint.kind != "prismatic" for joint in self.manifest.joints])
        near = np.where(turns, home + np.remainder(row - home + np.pi, 2 * np.pi) - np.pi, row)
        if np.isnan(self.loop_margins(near)).any():
            return ""
        j = int(np.argmax(abs(near - row) > 1))
        place = f"{self.joint_names[j]} = {near[j]:.4g}"
        return f"; give positions within half a turn of the assembly pose, such as {place}"

    def _of_joints(self, values: ArrayLike) -> Array:
        array = np.asarray(values, dtype=float)
        if array.ndim not in {1, 2} or array.shape[-1] != self.n_joints:
            raise ShapeError(
                f"expected ({self.n_joints},) or (N, {self.n_joints}) values of the joints "
                f"{', '.join(self.joint_names)}, got {array.shape}"
            )
        return array


class BodyKernels(Kernels):
    """Maps between λ, π and the matrices of inertia, link by link.

    Args:
        lam: (10 L,) or (N, 10 L) coordinates λ of the links.
        pi: (10 L,) or (N, 10 L) inertial parameters of the links.
        slope: ∂cost/∂π, shape of λ.
        floor: smallest eigenvalue of Σ_com over its trace.
    """

    def pi_from_lam(self, lam: ArrayLike) -> Array:
        """π of every link from λ. Source: Eqs. 4.25–4.31."""
        return self.binding.call("pi_from_lam", self._links("lam", lam))[0].reshape(np.shape(lam))

    def pi_jacobian(self, lam: ArrayLike) -> Array:
        """∂π_k/∂λ_k, (L, 10, 10) or (N, L, 10, 10)."""
        blocks = self.binding.call("pi_jacobian", self._links("lam", lam))[1]
        return blocks.reshape(*np.shape(lam)[:-1], self.n_links, N_PARAMETERS, N_PARAMETERS)

    def pi_from_cholesky(self, theta: ArrayLike) -> Array:
        """π of every link from log-Cholesky θ, P = U(θ) U(θ)ᵀ. Source: Rucker & Wensing 2022."""
        flat = self._links("theta", theta)
        return self.binding.call("cholesky_jacobian", flat)[0].reshape(np.shape(theta))

    def cholesky_jacobian(self, theta: ArrayLike) -> Array:
        """∂π_k/∂θ_k, (L, 10, 10) or (N, L, 10, 10)."""
        blocks = self.binding.call("cholesky_jacobian", self._links("theta", theta))[1]
        return blocks.reshape(*np.shape(theta)[:-1], self.n_links, N_PARAMETERS, N_PARAMETERS)

    def cholesky_from_pi(self, pi: ArrayLike) -> Array:
        """Log-Cholesky θ of every link; NaN where P is not positive definite."""
        flat = self._links("pi", pi)
        return self.binding.call("cholesky_from_pi", flat)[0].reshape(np.shape(pi))

    def pi_adjoint(self, lam: ArrayLike, slope: ArrayLike) -> Array:
        """(∂π/∂λ)ᵀ slope, link by link: ∂cost/∂λ (10 L,) from ∂cost/∂π. Source: Eq. 4.32."""
        links, slopes = self._links("lam", lam), self._links("slope", slope)
        frame = self.binding.call("pi_frame", links)[1]
        return self.binding.call("pi_adjoint", links, frame, slopes)[0].reshape(np.shape(lam))

    def lam_from_pi(self, pi: ArrayLike) -> Array:
        """λ of every link from π, with a ≥ b ≥ c. Source: Eqs. 4.18–4.23.

        Raises:
            NotRealisableError: a link is not physically consistent; `nearest_realisable` repairs
                it.
        """
        flat = self._links("pi", pi)
        lam = self.binding.call("lam_from_pi", flat)[0]
        bad = np.flatnonzero(~np.isfinite(lam).all(axis=1))
        if bad.size:
            links = ", ".join(dict.fromkeys(self.link_names[k % self.n_links] for k in bad))
            worst = self.relative_eigenvalues(flat[bad[0]])[0]
            raise NotRealisableError(
                f"pi of {links} is not physically consistent (smallest eigenvalue of "
                f"the pseudo-inertia {worst:.2e} of its trace); take nearest_realisable(pi) to "
                "continue with the nearest consistent parameters"
            )
        return lam.reshape(np.shape(pi))

    def nearest_realisable(self, pi: ArrayLike, floor: float = 1e-4) -> Array:
        """Nearest physically consistent π: each Σ_com becomes the nearest matrix with eigenvalues ≥
        floor · tr, while m and c stay. Shape of pi.
        """
        flat = self._links("pi", pi)
        return self.binding.call("nearest_realisable", flat, floor)[0].reshape(np.shape(pi))

    def inertia_matrix(self, lam: ArrayLike) -> Array:
        """M_k(λ_k), (L, 6, 6), linear part first. Source: Eq. 4.14."""
        blocks = self.binding.call("inertia_matrix", self._links("lam", lam))[0]
        return blocks.reshape(*np.shape(lam)[:-1], self.n_links, 6, 6)

    def pseudo_inertia(self, pi: ArrayLike) -> Array:
        """P_k(π_k), (L, 4, 4). Source: Eqs. 3.9, 3.10."""
        blocks = self.binding.call("pseudo_inertia", self._links("pi", pi))[0]
        return blocks.reshape(*np.shape(pi)[:-1], self.n_links, 4, 4)

    def relative_eigenvalues(self, pi: ArrayLike) -> Array:
        """Smallest eigenvalue of each P_k over its trace: positive means strictly consistent.

        NaN where π is not finite.
        """
        blocks = self.binding.call("pseudo_inertia", np.reshape(pi, (-1, N_PARAMETERS)))[0]
        finite = np.isfinite(blocks).all(axis=(1, 2))
        smallest = np.full(len(blocks), np.nan)
        smallest[finite] = np.linalg.eigvalsh(blocks[finite])[:, 0]
        traces = np.trace(blocks, axis1=1, axis2=2)
        return smallest / np.where(traces == 0, 1.0, np.abs(traces))

    def _links(self, name: str, value: ArrayLike) -> Array:
        """(10 L,) or (N, 10 L) as rows of one link each."""
        array = np.asarray(value, dtype=float)
        if array.ndim not in {1, 2} or array.shape[-1] != N_PARAMETERS * self.n_links:
            width = N_PARAMETERS * self.n_links
            raise ShapeError(
                f"{name} needs the shape ({width},) or (N, {width}), got {array.shape}"
            )
        return array.reshape(-1, N_PARAMETERS)


class SafetyKernels(Kernels):
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

    def torque_derivatives(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, pi: ArrayLike
    ) -> tuple[Array, Array, Array, Array]:
        """τ, shape of q, and ∂τ/∂q, ∂τ/∂dq, ∂τ/∂ddq = M(q), (N, n, n) each. Source: Eq. 4.3."""
        tau, dtau_dq, dtau_dv, dtau_da = self.binding.call("torque_derivatives", q, dq, ddq, pi)
        return tau, dtau_dq, dtau_dv, dtau_da

    def torque_rate(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, dddq: ArrayLike, pi: ArrayLike
    ) -> Array:
        """Torque rate dτ/dt = ∂τ/∂q dq + ∂τ/∂dq ddq + ∂τ/∂ddq dddq, shape of q [N·m/s, N/s]."""
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
        """Torque τ, dτ/dt and d²τ/dt² along a motion, shape of q each."""
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
        """∂(seed · dτ/dt)/∂(q, dq, ddq, dddq), (N, 4, n): three times the work of `torque_rate`."""
        return self.binding.call("torque_rate_adjoint", q, dq, ddq, dddq, pi, seed)[0]

    def torque_rate_jacobian(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, dddq: ArrayLike, pi: ArrayLike
    ) -> tuple[Array, Array]:
        """dτ/dt, shape of q, and its derivative by (q, dq, ddq, dddq) side by side, (N, n, 4 n).

        It takes n adjoints per sample; `torque_rate_adjoint` gives the rows of single joints.
        """
        rate = self.torque_rate(q, dq, ddq, dddq, pi)
        seeds = (np.broadcast_to(unit, rate.shape) for unit in np.eye(self.n_joints))
        rows = [self.torque_rate_adjoint(q, dq, ddq, dddq, pi, seed) for seed in seeds]
        return rate, np.stack(rows, axis=-3).reshape(*rate.shape, 4 * self.n_joints)

    def tip_motion(self, q: ArrayLike, dq: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """p and v of the tip in the base frame, (N, 3), ∂p/∂q = ∂v/∂dq and ∂v/∂q, (N, 3, n)."""
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


class ProofKernels(Kernels):
    """Suprema over K intervals from those of the joints; units are those of SI.

    Args:
        motion: bounds of |q| and its first derivatives in time, (K, orders, n).
        pi: (10 L,) inertial parameters of the links.
    """

    @property
    def bounds_motions(self) -> bool:
        """Whether the robot has these kernels; robots with closed loops have none."""
        return "torque_bounds" in self.manifest.kernels

    def torque_bounds(self, motion: ArrayLike, pi: ArrayLike) -> Array:
        """Bounds (K, 4, n) of |τ| and three derivatives in time, from six orders of the motion."""
        return self.binding.call("torque_bounds", motion, pi)[0]

    def tip_bounds(self, motion: ArrayLike) -> Array:
        """Bounds (K, 4) of the tip's distance from the base and of three derivatives, from four."""
        return self.binding.call("tip_bounds", motion)[0]

    def speed_bounds(self, motion: ArrayLike) -> tuple[Array, Array]:
        """Bounds of the speed that joint j gives to link i: its origin, and turning about it.

        (K, L, L) [m/s], 0 where joint j does not move link i, and (K, L) [rad/s]. A point of the
        link at a distance r from its origin gets origin + r · turn at most. The motion has two
        orders, |q| and |dq|.
        """
        origin, turn = self.binding.call("speed_bounds", motion)
        return origin, turn
