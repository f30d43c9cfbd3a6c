"""Programs on top of the kernels: which of them a robot's kernels allow, and their tables."""

import re
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

from symgen.emit.elimination import eliminate, fill_in
from symgen.emit.ssa import TileProgram, c_body
from symgen.kernel import Argument, Kernel

LANES = 8
"""Samples, or links, of a tile: LANES of lanes.h."""
_SIDE = 4

Kernels = dict[str, Kernel]
Tiles = dict[str, TileProgram]


@dataclass(frozen=True, slots=True)
class Program:
    """A file to render beside the kernels, what its template needs, headers it includes as are."""

    file: str
    context: dict[str, Any]
    includes: tuple[str, ...] = ()


def programs(
    kernels: tuple[Kernel, ...], tiles: Tiles, facts: dict[str, Any]
) -> tuple[Program, ...]:
    """The programs whose kernels are there."""
    by_name = {kernel.name: kernel for kernel in kernels}
    found = []
    if by_name.keys() >= _STATISTICS:
        tables = _statistics(by_name, tiles)
        found += [Program("statistics.c", tables), Program("update.c", tables)]
    if by_name.keys() >= _DESCENT:
        found.append(Program("descent.c", _descent(by_name, tiles)))
    if by_name.keys() >= _CONVEX:
        found.append(Program("convex.c", _convex(by_name)))
    if by_name.keys() >= _ONLINE:
        found.append(Program("online.c", _online(by_name)))
        found.append(Program("example_online.c", _example(facts)))
    if by_name.keys() >= _EXCITATION:
        found.append(Program("excitation.c", _excitation(by_name, tiles), ("eigen.h",)))
    if by_name.keys() >= _CLOSED_LOOP:
        joints = by_name["bias_forces"].outputs[0].size
        found.append(Program("closed_loop.c", {"joints": joints}))
    if by_name.keys() >= _EXAMPLE:
        found.append(Program("example.c", _example(facts)))
    return tuple(found)


_STATISTICS = {"base_regressor"}
_DESCENT = {
    "loss_gradient",
    "pi_frame",
    "pi_adjoint",
    "pi_jacobian",
    "cholesky_jacobian",
    "base_parameters",
    "base_adjoint",
}
_CONVEX = {"barrier", "base_parameters"}
_ONLINE = _STATISTICS | _CONVEX | {"base_adjoint", "inverse_dynamics", "nearest_realisable"}
_EXCITATION = {"base_regressor", "regressor_adjoint"}
_CLOSED_LOOP = {"inverse_dynamics", "mass_matrix", "bias_forces"}
_EXAMPLE = {"inverse_dynamics", "regressor", "base_regressor"}


def _statistics(kernels: Kernels, tiles: Tiles) -> dict[str, Any]:
    """Tables of the rows [Y_b tau] for the programs that eliminate them."""
    (output,) = kernels["base_regressor"].outputs
    joints, base = output.shape
    filled = tiles["base_regressor"].filled[output.name]
    entries = {divmod(index, base) for index in filled}
    pattern = [[(i, c) in entries for c in range(base)] + [True] for i in range(joints)]
    panels = eliminate(pattern, base)
    rows: list[int] = []
    columns: list[int] = []
    placed = []
    for p in panels:
        placed.append(
            {
                "first": p.first,
                "width": p.width,
                "row_at": len(rows),
                "rows": p.rows,
                "column_at": len(columns),
                "columns": p.columns,
            }
        )
        rows += p.rows
        columns += p.columns
    per_joint = [[c for c in range(base + 1) if row[c]] for row in pattern]
    body = tiles["base_regressor"].body
    return {
        "joints": joints,
        "base": base,
        "row_equation": kernels["base_regressor"].equation,
        "rows_body": [_placed(line, output.name, base) for line in body],
        "panels": placed,
        "row_table": rows,
        "column_table": columns,
        "cleared": fill_in(pattern, panels),
        "joint_table": [c for row in per_joint for c in row],
        "joint_at": [sum(map(len, per_joint[:i])) for i in range(joints + 1)],
    }


def _placed(line: str, output: str, columns: int) -> str:
    """A statement of a tile, its output by joint and column: `PUT(joint, column, value)`."""
    match = re.fullmatch(rf"{output}\[(\d+) \* VS\] = (.*);", line)
    if match is None:
        return line
    joint, column = divmod(int(match[1]), columns)
    return f"PUT({joint}, {column}, {match[2]});"


def _run(columns: list[int]) -> tuple[int, int]:
    """From the first to behind the last of them."""
    return (columns[0], columns[-1] + 1) if columns else (0, 0)


def _descent(kernels: Kernels, tiles: Tiles) -> dict[str, Any]:
    """Sizes for the descents in λ."""
    (pi,), (beta,) = kernels["base_parameters"].inputs, kernels["base_parameters"].outputs
    lam, frame, _ = kernels["pi_adjoint"].inputs
    return {
        "parameters": lam.size,
        "frame": frame.size,
        "joints": kernels["loss_gradient"].inputs[0].size,
        "links": pi.size // lam.size,
        "base": beta.size,
        "uniform": max(tiles["loss_gradient"].uniform, 1),
        "slides": len(tiles["loss_gradient"].turns) < kernels["loss_gradient"].inputs[0].size,
        "to_base": _on_tiles(kernels["base_parameters"], pi, lam.size),
        "from_base": _on_tiles(
            kernels["base_adjoint"], kernels["base_adjoint"].outputs[0], lam.size
        ),
    }


def _on_tiles(kernel: Kernel, bodies: Argument, size: int) -> dict[str, Any]:
    """A map from or to all links, `size` numbers each, these as tiles whose lanes are links."""

    def place(match: re.Match[str]) -> str:
        link, entry = divmod(int(match[1]), size)
        return f"{bodies.name}[{(link // LANES * size + entry) * LANES + link % LANES}]"

    (given,), (wanted,) = kernel.inputs, kernel.outputs
    pattern = re.compile(rf"\b{bodies.name}\[(\d+)\]")
    return {
        "equation": kernel.equation,
        "input": given.name,
        "output": wanted.name,
        "body": [pattern.sub(place, line) for line in c_body(kernel)],
    }


def _convex(kernels: Kernels) -> dict[str, Any]:
    """Sizes for the convex estimators."""
    (own,), (pi,) = kernels["barrier"].inputs, kernels["base_parameters"].inputs
    return {"parameters": own.size, "links": pi.size // own.size}


def _online(kernels: Kernels) -> dict[str, Any]:
    """Sizes of the streaming estimator's state."""
    sizes = _convex(kernels)
    joints, base = kernels["base_regressor"].outputs[0].shape
    width = -(-sizes["links"] * sizes["parameters"] // 8) * 8
    return sizes | {"joints": joints, "base": base, "width": width}


def _excitation(kernels: Kernels, tiles: Tiles) -> dict[str, Any]:
    """Which rows of the base regressor are filled where; blocks of the Gram matrix are 4 × 4."""
    (output,) = kernels["base_regressor"].outputs
    joints, columns = output.shape
    program, adjoint = tiles["base_regressor"], tiles["regressor_adjoint"]
    filled = [
        sorted(k % columns for k in program.filled[output.name] if k // columns == j)
        for j in range(joints)
    ]
    blocks = [{c // _SIDE for c in row} for row in filled]
    shared: list[int] = []
    ends: list[int] = []
    for i, j in combinations_with_replacement(range(-(-columns // _SIDE)), 2):
        shared += [row for row in range(joints) if {i, j} <= blocks[row]]
        ends.append(len(shared))
    return {
        "joints": joints,
        "columns": columns,
        "spans": [_run(row) for row in filled],
        "block_ends": ends,
        "block_joints": shared or [0],
        "base_turns_more": not set(program.turns) <= set(adjoint.turns),
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
