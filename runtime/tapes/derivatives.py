"""Exact first derivatives of the kernels, by other kernels; one text for torch and JAX.

    ∂τ/∂q, ∂τ/∂dq, ∂τ/∂ddq = M: `torque_derivatives`      ∂τ/∂π = Y: `regressor`
    h = τ(ddq = 0)      M eⱼ = τ(q, 0, eⱼ) − τ(q, 0, 0), column by column
    ddq = (M + diag(J))⁻¹ (τ − h)  →  d ddq = (M + diag(J))⁻¹ (dτ − ∂τ/∂x dx − diag(ddq) dJ)

Arrays are those of the caller, (..., size) with leading axes that broadcast. Derivatives of
kernel outputs (..., *shape) are (..., *shape, size). Source: Carpentier & Mansard, RSS 2018.
"""

from collections.abc import Callable, Sequence
from typing import Any

from runtime.library import Library

Tensor = Any
"""Array of torch or JAX."""
Call = Callable[..., Sequence[Tensor]]
"""Outputs of a kernel: name, then its inputs."""

DIFFERENTIABLE = {
    *("inverse_dynamics", "bias_forces", "mass_matrix", "forward_dynamics"),
    *("loss_gradient", "pi_from_lam"),
}
"""Kernels whose derivatives stand here; those of their derivatives do not."""


def derivatives(
    xp: Any,
    call: Call,
    name: str,
    inputs: Sequence[Tensor],
    outputs: Sequence[Tensor],
    needed: Sequence[bool],
    lib: Library,
) -> list[Tensor | None]:
    """Return the derivatives of the first output of a kernel by its needed inputs.

    Those of `loss_gradient`, summed over samples, have the shapes of its inputs.
    """
    if name == "pi_from_lam":
        return [call("pi_jacobian", *inputs)[1]]
    if name == "inverse_dynamics":
        return _by_motion(call, inputs, needed)
    if name == "bias_forces":
        q, dq, pi = inputs
        by_q, by_dq, _, by_pi = _by_motion(
            call, (q, dq, xp.zeros_like(dq), pi), (*needed[:2], False, needed[2])
        )
        return [by_q, by_dq, by_pi]
    if name == "mass_matrix":
        return _of_mass(xp, call, inputs, needed)
    if name == "forward_dynamics":
        return _of_acceleration(xp, call, inputs, outputs[0], needed)
    return _of_loss(xp, call, inputs, outputs, needed, lib)


def tangent_of(
    xp: Any,
    call: Call,
    name: str,
    inputs: Sequence[Tensor],
    outputs: Sequence[Tensor],
    tangents: Sequence[Tensor | None],
    lib: Library,
) -> Tensor:
    """Return the tangent of the first output of a kernel from those of its inputs, None: zero."""
    axes = "ij"[: len(lib.kernel_facts(name).outputs[0].shape)]
    needed = [tangent is not None for tangent in tangents]
    parts = derivatives(xp, call, name, inputs, outputs, needed, lib)
    total = xp.zeros_like(outputs[0])
    for tangent, part in zip(tangents, parts, strict=True):
        if tangent is not None and name == "loss_gradient":
            total = total + (part * tangent).sum()
        elif tangent is not None:
            total = total + xp.einsum(f"...{axes}x,...x->...{axes}", part, tangent)
    return total


def _by_motion(call: Call, inputs: Sequence[Tensor], needed: Sequence[bool]) -> list[Tensor | None]:
    """∂τ by q, dq, ddq and π."""
    q, dq, ddq, pi = inputs
    by_q = by_dq = mass = by_pi = None
    if needed[0] or needed[1]:
        _, by_q, by_dq, mass = call("torque_derivatives", *inputs)
    elif needed[2]:
        (mass,) = call("mass_matrix", q, pi)
    if needed[3]:
        (by_pi,) = call("regressor", q, dq, ddq)
    return [by_q, by_dq, mass, by_pi]


def _of_mass(
    xp: Any, call: Call, inputs: Sequence[Tensor], needed: Sequence[bool]
) -> list[Tensor | None]:
    """∂M by q and π, from the torques of unit accelerations less that of none."""
    q, pi = (x[..., None, :] for x in inputs)
    n = q.shape[-1]
    unit = xp.eye(n + 1, dtype=q.dtype)[:, :n]
    rest = xp.zeros_like(unit[0])
    slopes = _by_motion(call, (q, rest, unit, pi), (needed[0], False, False, needed[1]))

    def columns(slope: Tensor | None) -> Tensor | None:
        return (
            None
            if slope is None
            else xp.swapaxes(slope[..., :n, :, :] - slope[..., n:, :, :], -3, -2)
        )

    return [columns(slopes[0]), columns(slopes[3])]


def _of_acceleration(
    xp: Any, call: Call, inputs: Sequence[Tensor], ddq: Tensor, needed: Sequence[bool]
) -> list[Tensor | None]:
    """∂ddq by q, dq, τ, π and the inertia J of the rotors."""
    q, dq, _, pi, rotor = inputs
    by_q, by_dq, _, by_pi = _by_motion(call, (q, dq, ddq, pi), (*needed[:2], False, needed[3]))
    eye = xp.eye(q.shape[-1], dtype=q.dtype)
    mass = call("mass_matrix", q, pi)[0] + eye * rotor[..., None, :]
    sides = (by_q, by_dq, -eye, by_pi, eye * ddq[..., None, :])
    return [
        -xp.linalg.solve(mass, side + xp.zeros_like(mass[..., :1])) if use else None
        for side, use in zip(sides, needed, strict=True)
    ]


def _of_loss(
    xp: Any,
    call: Call,
    inputs: Sequence[Tensor],
    outputs: Sequence[Tensor],
    needed: Sequence[bool],
    lib: Library,
) -> list[Tensor | None]:
    """∂L of L = Σ ½ rᵀ W r, r = Y_b β − τ, by q, dq, ddq, τ, W and β."""
    q, dq, ddq, _, weight, beta = inputs
    _, gradient, residual = outputs
    push = weight * residual
    by_state: list[Tensor | None] = [None, None, None]
    if any(needed[:3]):
        place = {column: k for k, column in enumerate(lib.base_columns)}
        entries = [beta[place[k]] if k in place else 0 * beta[0] for k in range(lib.pi0.size)]
        _, *slopes = call("torque_derivatives", q, dq, ddq, xp.stack(entries))
        by_state = [(push[..., None, :] @ slope)[..., 0, :] for slope in slopes]
    by_weight = (residual * residual / 2).reshape(-1, weight.shape[-1]).sum(0)
    return [*by_state, -push, by_weight, gradient]
