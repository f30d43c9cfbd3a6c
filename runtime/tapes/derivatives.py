"""Exact first derivatives of the kernels, by other kernels; one text for torch and JAX.

    ∂τ/∂q, ∂τ/∂dq, ∂τ/∂ddq = M: `torque_derivatives`      ∂τ/∂π = Y: `regressor`
    h = τ(ddq = 0)      M eⱼ = τ(q, 0, eⱼ) − τ(q, 0, 0), column by column
    ddq = (M + diag(J))⁻¹ (τ − h)  →  d ddq = (M + diag(J))⁻¹ (dτ − ∂τ/∂x dx − diag(ddq) dJ)

Arrays are those of the caller, (..., size) with leading axes that broadcast. Derivatives of
kernel outputs (..., *shape) are (..., *shape, size). Source: Carpentier & Mansard, RSS 2018.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from runtime.library import Library

Tensor = Any  # array of torch or JAX
Call = Callable[..., Sequence[Tensor]]  # outputs of a kernel: name, then its inputs

DIFFERENTIABLE = {  # kernels whose derivatives stand here; those of their derivatives do not
    *("inverse_dynamics", "bias_forces", "mass_matrix", "forward_dynamics"),
    *("loss_gradient", "pi_from_lam"),
}


@dataclass(frozen=True, slots=True, eq=False)
class KernelCall:
    """A call of a kernel on arrays of `xp`, and the derivatives of its first output."""

    xp: Any  # torch or jax.numpy
    call: Call
    lib: Library
    name: str  # of the kernel
    inputs: Sequence[Tensor]
    outputs: Sequence[Tensor]

    def derivatives(self, needed: Sequence[bool]) -> list[Tensor | None]:
        """Derivatives by the needed inputs; those of `loss_gradient` are summed over samples."""
        if self.name == "pi_from_lam":
            return [self.call("pi_jacobian", *self.inputs)[1]]
        if self.name == "inverse_dynamics":
            return self._of_torque(self.inputs, needed)
        if self.name == "bias_forces":
            q, dq, pi = self.inputs
            wanted = (*needed[:2], False, needed[2])
            by_q, by_dq, _, by_pi = self._of_torque((q, dq, self.xp.zeros_like(dq), pi), wanted)
            return [by_q, by_dq, by_pi]
        if self.name == "mass_matrix":
            return self._of_mass(needed)
        if self.name == "forward_dynamics":
            return self._of_acceleration(needed)
        return self._of_loss(needed)

    def tangent(self, tangents: Sequence[Tensor | None]) -> Tensor:
        """Return the tangent of the output from those of the inputs, None: zero."""
        axes = "ij"[: len(self.lib.binding.kernel(self.name).outputs[0].shape)]
        parts = self.derivatives([tangent is not None for tangent in tangents])
        total = self.xp.zeros_like(self.outputs[0])
        for tangent, part in zip(tangents, parts, strict=True):
            if tangent is not None and self.name == "loss_gradient":
                total = total + (part * tangent).sum()
            elif tangent is not None:
                total = total + self.xp.einsum(f"...{axes}x,...x->...{axes}", part, tangent)
        return total

    def _of_torque(self, inputs: Sequence[Tensor], needed: Sequence[bool]) -> list[Tensor | None]:
        """∂τ by q, dq, ddq and π."""
        q, dq, ddq, pi = inputs
        by_q = by_dq = mass = by_pi = None
        if needed[0] or needed[1]:
            _, by_q, by_dq, mass = self.call("torque_derivatives", *inputs)
        elif needed[2]:
            (mass,) = self.call("mass_matrix", q, pi)
        if needed[3]:
            (by_pi,) = self.call("regressor", q, dq, ddq)
        return [by_q, by_dq, mass, by_pi]

    def _of_mass(self, needed: Sequence[bool]) -> list[Tensor | None]:
        """∂M by q and π, from the torques of unit accelerations less that of none."""
        q, pi = (x[..., None, :] for x in self.inputs)
        n = q.shape[-1]
        unit = self.xp.eye(n + 1, dtype=q.dtype)[:, :n]
        motion = (q, self.xp.zeros_like(unit[0]), unit, pi)
        by_q, _, _, by_pi = self._of_torque(motion, (needed[0], False, False, needed[1]))

        def columns(slope: Tensor) -> Tensor:
            return self.xp.swapaxes(slope[..., :n, :, :] - slope[..., n:, :, :], -3, -2)

        return [None if slope is None else columns(slope) for slope in (by_q, by_pi)]

    def _of_acceleration(self, needed: Sequence[bool]) -> list[Tensor | None]:
        """∂ddq by q, dq, τ, π and the inertia J of the rotors."""
        xp, (q, dq, _, pi, rotor), ddq = self.xp, self.inputs, self.outputs[0]
        wanted = (*needed[:2], False, needed[3])
        by_q, by_dq, _, by_pi = self._of_torque((q, dq, ddq, pi), wanted)
        eye = xp.eye(q.shape[-1], dtype=q.dtype)
        mass = self.call("mass_matrix", q, pi)[0] + eye * rotor[..., None, :]
        sides = (by_q, by_dq, -eye, by_pi, eye * ddq[..., None, :])
        return [
            -xp.linalg.solve(mass, side + xp.zeros_like(mass[..., :1])) if use else None
            for side, use in zip(sides, needed, strict=True)
        ]

    def _of_loss(self, needed: Sequence[bool]) -> list[Tensor | None]:
        """∂L of L = Σ ½ rᵀ W r, r = Y_b β − τ, by q, dq, ddq, τ, W and β."""
        q, dq, ddq, _, weight, beta = self.inputs
        _, gradient, residual = self.outputs
        push = weight * residual
        by_state: list[Tensor | None] = [None, None, None]
        if any(needed[:3]):
            place = {column: k for k, column in enumerate(self.lib.base_columns)}
            every = range(self.lib.pi0.size)
            entries = [beta[place[k]] if k in place else 0 * beta[0] for k in every]
            _, *slopes = self.call("torque_derivatives", q, dq, ddq, self.xp.stack(entries))
            by_state = [(push[..., None, :] @ slope)[..., 0, :] for slope in slopes]
        by_weight = (residual * residual / 2).reshape(-1, weight.shape[-1]).sum(0)
        return [*by_state, -push, by_weight, gradient]
