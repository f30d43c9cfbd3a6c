"""Motion of all joints from that of the independent ones: q_all = A q + b, or by closed loops.

Closed loops: φ(q, d) = 0 by Newton in C from the assembly pose, with NaN at singular postures,
which are refused here by the name of the loop.
"""

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import PostureError, ShapeError
from runtime.library.binding import Array, Binding
from runtime.library.manifest import Manifest


class JointKernels:
    """Positions, velocities and Jacobian of all joints; q and dq are (N, n) or (n,)."""

    name: str
    n_joints: int
    n_links: int
    joint_names: tuple[str, ...]
    manifest: Manifest
    _binding: Binding

    def all_positions(self, q: ArrayLike) -> Array:
        """Positions of all joints, in the order of `all_joint_names`: A q + b, or g(q) with loops.

        Args:
            q: (N, n) or (n,) positions of the independent joints [rad, m].

        Returns:
            (N, L) or (L,) [rad, m].

        Raises:
            ShapeError: q has another number of joints.
            PostureError: a loop cannot close at q, or is singular there.
        """
        coupling, q = self.manifest.coupling, self._of_joints(q)
        if not self.manifest.loops:
            return q.copy() if coupling is None else q @ coupling.matrix.T + coupling.offset
        self.require_closed(q)
        zero = np.zeros(self.n_joints)
        return self._binding.call("all_joints", q, zero, zero)[0]

    def all_velocities(self, dq: ArrayLike, q: ArrayLike | None = None) -> Array:
        """Velocities of all joints: A dq, or G(q) dq with loops.

        Args:
            dq: (N, n) or (n,) velocities of the independent joints [rad/s, m/s].
            q: their positions, shape of dq [rad, m]; needed with loops only.

        Returns:
            (N, L) or (L,) [rad/s, m/s].

        Raises:
            ShapeError: dq has another number of joints, or q is missing.
            PostureError: a loop cannot close at q, or is singular there.
        """
        coupling, dq = self.manifest.coupling, self._of_joints(dq)
        if not self.manifest.loops:
            return dq.copy() if coupling is None else dq @ coupling.matrix.T
        return self.all_motion(self._given(q), dq, 0 * dq)[1]

    def all_motion(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations of all joints.

        Args:
            q: (N, n) or (n,) positions of the independent joints [rad, m].
            dq: velocities, shape of q [rad/s, m/s].
            ddq: accelerations, shape of q [rad/s², m/s²].

        Returns:
            q_all, dq_all and ddq_all, (N, L) or (L,) each.

        Raises:
            ShapeError: an array has another number of joints.
            PostureError: a loop cannot close at q, or is singular there.
        """
        if not self.manifest.loops:
            return self.all_positions(q), self.all_velocities(dq), self.all_velocities(ddq)
        self.require_closed(q)
        return self.motion_or_nan(q, dq, ddq)

    def motion_or_nan(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Motion of all joints as `all_motion`, with NaN where a loop cannot close.

        Args:
            q: (N, n) or (n,) positions of the independent joints [rad, m].
            dq: velocities, shape of q [rad/s, m/s].
            ddq: accelerations, shape of q [rad/s², m/s²].

        Returns:
            q_all, dq_all and ddq_all, (N, L) or (L,) each.
        """
        if not self.manifest.loops:
            return self.all_motion(q, dq, ddq)
        motion = (self._of_joints(values) for values in (q, dq, ddq))
        positions, velocities, accelerations = self._binding.call("all_joints", *motion)
        return positions, velocities, accelerations

    def next_positions(self, q: ArrayLike, last: ArrayLike) -> Array:
        """Positions of all joints from those of a sample shortly before, for a control loop.

        Args:
            q: (N, n) or (n,) positions of the independent joints [rad, m].
            last: (N, L) or (L,) positions of all joints before [rad, m].

        Returns:
            Shape of last; NaN where a loop cannot close or is singular. Without loops A q + b.
        """
        if not self.manifest.loops:
            return self.all_positions(q)
        return self._binding.call("next_positions", q, last)[0]

    def joint_jacobian(self, q: ArrayLike) -> Array:
        """G = ∂q_all/∂q: τ = Gᵀ τ_all.

        Args:
            q: (N, n) or (n,) positions of the independent joints [rad, m].

        Returns:
            (N, L, n) or (L, n).

        Raises:
            PostureError: a loop cannot close at q, or is singular there.
        """
        q, coupling = self._of_joints(q), self.manifest.coupling
        if not self.manifest.loops:
            matrix = np.eye(self.n_joints) if coupling is None else coupling.matrix
            return np.broadcast_to(matrix, (*q.shape[:-1], *matrix.shape)).copy()
        self.require_closed(q)
        return self._binding.call("joint_jacobian", q)[0]

    def loop_margins(self, q: ArrayLike) -> Array:
        """Distance of each loop from a singular posture: 1 in the assembly pose, 0 where singular.

        Args:
            q: (N, n) or (n,) positions of the independent joints [rad, m].

        Returns:
            (N, blocks) or (blocks,), NaN where a loop cannot close; no columns without loops.
        """
        q = self._of_joints(q)
        if not self.manifest.loops:
            return np.zeros((*q.shape[:-1], 0))
        return self._binding.call("joint_jacobian", q)[1]

    def require_closed(self, q: ArrayLike) -> None:
        """Check that all loops close and are not singular at finite positions.

        Args:
            q: (N, n) or (n,) positions of the independent joints [rad, m].

        Raises:
            PostureError: the message names the loops, the first position and the number of such.
        """
        rows = np.atleast_2d(self._of_joints(q))
        if not self.manifest.loops or not len(rows):
            return
        bad = np.isnan(self.loop_margins(rows)).any(axis=1) & np.isfinite(rows).all(axis=1)
        if bad.any():
            first = int(np.argmax(bad))
            at = ", ".join(
                f"{name} = {value:.4g}"
                for name, value in zip(self.joint_names, rows[first], strict=True)
            )
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
        names = [
            f"{name} = {value:.4g}"
            for name, value, moved in zip(self.joint_names, near, abs(near - row) > 1, strict=True)
            if moved
        ]
        return f"; give positions within half a turn of the assembly pose, such as {names[0]}"

    def _given(self, q: ArrayLike | None) -> ArrayLike:
        if q is None:
            raise ShapeError(
                f"the velocities of all joints of '{self.name}' depend on its loops' posture; call "
                "all_velocities(dq, q)"
            )
        return q

    def _of_joints(self, values: ArrayLike) -> Array:
        array = np.asarray(values, dtype=float)
        if array.ndim not in {1, 2} or array.shape[-1] != self.n_joints:
            raise ShapeError(
                f"expected ({self.n_joints},) or (N, {self.n_joints}) values of the joints "
                f"{', '.join(self.joint_names)}, got {array.shape}"
            )
        return array
