"""Programs on top of the kernels: which of them a robot's kernels allow, and their tables."""

from dataclasses import dataclass
from typing import Any

from symgen.emit.ssa import TileProgram
from symgen.kernel import Kernel

Kernels = dict[str, Kernel]
Tiles = dict[str, TileProgram]


@dataclass(frozen=True, slots=True)
class Program:
    """A file to render beside the kernels, and what its template needs beyond theirs."""

    file: str
    context: dict[str, Any]


def programs(
    kernels: tuple[Kernel, ...], tiles: Tiles, facts: dict[str, Any]
) -> tuple[Program, ...]:
    """The programs whose kernels are there."""
    by_name = {kernel.name: kernel for kernel in kernels}
    known = (
        ("descent.c", _DESCENT, lambda: _descent(by_name, tiles)),
        ("example.c", _EXAMPLE, lambda: _example(facts)),
    )
    return tuple(Program(file, make()) for file, need, make in known if by_name.keys() >= need)


_DESCENT = {"loss_gradient", "pi_jacobian", "base_parameters", "base_adjoint"}
_EXAMPLE = {"inverse_dynamics", "regressor"}


def _descent(kernels: Kernels, tiles: Tiles) -> dict[str, Any]:
    """Sizes for the descents in λ."""
    (pi,), (beta,) = kernels["base_parameters"].inputs, kernels["base_parameters"].outputs
    (lam,) = kernels["pi_jacobian"].inputs
    return {
        "parameters": lam.size,
        "joints": kernels["loss_gradient"].inputs[0].size,
        "links": pi.size // lam.size,
        "base": beta.size,
        "uniform": max(tiles["loss_gradient"].uniform, 1),
    }


def _example(facts: dict[str, Any]) -> dict[str, Any]:
    """A state of the robot, its parameters and its joints; Python's shortest digits are C's too."""
    signs = [(-1.0) ** k for k in range(len(facts["joints"]))]
    return {
        "joints": facts["joints"],
        "pi0": [float(x) for x in facts["pi0"]],
        "home": [float(x) for x in facts["home"]],
        "dq": [0.5 * sign for sign in signs],
        "ddq": [2.0 * sign for sign in signs],
    }
