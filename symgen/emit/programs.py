"""Programs built on the kernels: those that a robot's kernels allow, and their tables.

Tables of the statistics name the rows and columns that take part when rows of a constant 0/1
pattern are eliminated. One row of the pattern stands for all rows of that kind, such as those of
one joint. They are eliminated into a triangular factor, column by column, by orthogonal
transformations. A transformation mixes the rows that it touches, so each of them is filled where
any of them was (George & Heath, Linear Algebra Appl. 34, 1980).
"""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations_with_replacement
from typing import Any

from symgen.emit.sample import c_body
from symgen.emit.ssa import TileProgram
from symgen.kernel import Argument, Kernel, Kernels, KernelsByName

Tiles = dict[str, TileProgram]

LANES = 8  # samples, or links, of a tile: LANES of lanes.h
_SIDE = 4  # rows and columns of a block of the Gram matrix
PANEL = 8  # largest number of columns of a panel: they stay in the first-level cache while applied


@dataclass(frozen=True, slots=True)
class Panel:
    """Neighbouring columns with the same rows, each with all later ones to its right."""

    first: int  # the leftmost column
    width: int  # number of columns, at most `PANEL`
    rows: tuple[int, ...]  # rows with an entry in these columns, ascending
    columns: tuple[int, ...]  # columns to the right of the panel that change, ascending


@dataclass(frozen=True, slots=True)
class Range:
    """Neighbouring columns, `first` to before `end`, and the rows that they share with others."""

    first: int
    end: int
    rows: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Run:
    """Neighbouring columns with the same rows."""

    first: int  # the leftmost column
    width: int  # number of columns
    ranges: tuple[Range, ...]  # columns from `first` on that share rows with them, ascending


@dataclass(frozen=True, slots=True)
class Program:
    """A file to render beside the kernels."""

    file: str  # name of the file
    context: dict[str, Any]  # values for its template
    includes: tuple[str, ...] = ()  # headers of `templates/` that it includes, copied unchanged


def programs(kernels: Kernels, tiles: Tiles, facts: dict[str, Any]) -> tuple[Program, ...]:
    """Return the programs whose kernels are all in the catalogue."""
    by_name = {kernel.name: kernel for kernel in kernels}
    chosen = []
    vectors = tiles.keys()
    if vectors >= _STATISTICS:
        tables = _statistics(by_name, tiles)
        chosen += [Program("statistics.c", tables, ("fold.h", "gram.h"))]
        chosen.append(Program("update.c", tables))
    if by_name.keys() >= _DESCENT and "loss_gradient" in vectors:
        chosen.append(Program("descent.c", _descent(by_name, tiles)))
    if by_name.keys() >= _CONVEX:
        chosen.append(Program("convex.c", _convex(by_name)))
    if by_name.keys() >= _ONLINE and vectors >= _STATISTICS:
        chosen.append(Program("online.c", _online(by_name)))
        chosen.append(Program("example_online.c", _example(facts)))
    if vectors >= _EXCITATION:
        chosen.append(Program("excitation.c", _excitation(by_name, tiles), ("eigen.h",)))
    if by_name.keys() >= _CLOSED_LOOP and not facts.get("floating"):
        chosen.append(Program("closed_loop.c", {"joints": by_name["bias_forces"].outputs[0].size}))
    if by_name.keys() >= _EXAMPLE and vectors >= _STATISTICS:
        chosen.append(Program("example.c", _example(facts)))
    return tuple(chosen)


_STATISTICS = {"base_regressor"}
_DESCENT = {
    *("loss_gradient", "pi_frame", "pi_adjoint", "pi_jacobian", "cholesky_jacobian"),
    *("base_parameters", "base_adjoint"),
}
_CONVEX = {"barrier", "base_parameters"}
_ONLINE = _STATISTICS | _CONVEX | {"base_adjoint", "inverse_dynamics", "nearest_realisable"}
_EXCITATION = {"base_regressor", "regressor_adjoint"}
_CLOSED_LOOP = {"inverse_dynamics", "mass_matrix", "bias_forces"}
_EXAMPLE = {"inverse_dynamics", "regressor", "base_regressor"}


def _statistics(kernels: KernelsByName, tiles: Tiles) -> dict[str, Any]:
    """Tables for the programs that eliminate the rows [Y_b tau]."""
    (output,) = kernels["base_regressor"].outputs
    joints, base = output.shape
    entries = {divmod(index, base) for index in tiles["base_regressor"].filled[output.name]}
    # One row per joint, with the torque as the last column; George & Heath gives the panels.
    pattern = [[(i, c) in entries for c in range(base)] + [True] for i in range(joints)]
    panels = eliminate(pattern, base)
    rows: list[int] = []
    columns: list[int] = []
    placed = []
    for p in panels:
        placed.append(asdict(p) | {"row_at": len(rows), "column_at": len(columns)})
        rows += p.rows
        columns += p.columns
    per_joint = [[c for c in range(base + 1) if row[c]] for row in pattern]
    return {
        "joints": joints,
        "base": base,
        "row_equation": kernels["base_regressor"].equation,
        "rows_body": [_placed(line, output.name, base) for line in tiles["base_regressor"].body],
        "panels": placed,
        "row_table": rows,
        "column_table": columns,
        "cleared": fill_in(pattern, panels),
        "joint_table": [c for row in per_joint for c in row],
        "joint_at": [sum(map(len, per_joint[:i])) for i in range(joints + 1)],
        **_products(shared_columns(pattern)),
    }


def _products(runs: tuple[Run, ...]) -> dict[str, Any]:
    """Tables of the columns whose products are summed."""
    placed, ranges, rows = [], list[dict[str, Any]](), list[int]()
    for run in runs:
        placed.append(asdict(run) | {"range_at": len(ranges)})
        for item in run.ranges:
            ranges.append(asdict(item) | {"row_at": len(rows)})
            rows += item.rows
    return {"runs": placed, "range_table": ranges, "range_row_table": rows}


def _placed(line: str, output: str, columns: int) -> str:
    """A statement of a tile with its output by joint and column: `PUT(joint, column, value)`."""
    match = re.fullmatch(rf"{output}\[(\d+) \* VS\] = (.*);", line)
    if match is None:
        return line
    joint, column = divmod(int(match[1]), columns)
    return f"PUT({joint}, {column}, {match[2]});"


def _descent(kernels: KernelsByName, tiles: Tiles) -> dict[str, Any]:
    """Sizes for the descent methods in λ."""
    (pi,), (beta,) = kernels["base_parameters"].inputs, kernels["base_parameters"].outputs
    lam, frame, _ = kernels["pi_adjoint"].inputs
    return {
        "parameters": lam.size,
        "frame": frame.size,
        "joints": kernels["loss_gradient"].inputs[0].size,
        "links": pi.size // lam.size,
        "base": beta.size,
        "uniform": max(tiles["loss_gradient"].uniform, 1),
        "slides": _reads_positions(kernels["loss_gradient"], tiles["loss_gradient"]),
        "to_base": _on_tiles(kernels["base_parameters"], pi, lam.size),
        "from_base": _on_tiles(
            kernels["base_adjoint"], kernels["base_adjoint"].outputs[0], lam.size
        ),
    }


def _reads_positions(kernel: Kernel, tile: TileProgram) -> bool:
    """Whether positions are needed beside their sines: of prismatic joints and of closed chains."""
    q = kernel.inputs[0]
    read = re.compile(rf"\b{q.name}\[")
    return len(tile.turns) < q.size or any(read.search(line) for line in tile.body)


def _on_tiles(kernel: Kernel, bodies: Argument, size: int) -> dict[str, Any]:
    """A map from or to all links, `size` numbers each, on tiles whose lanes are links."""

    def place(match: re.Match[str]) -> str:
        link, entry = divmod(int(match[1]), size)
        return f"{bodies.name}[{(link // LANES * size + entry) * LANES + link % LANES}]"

    (source,), (result,) = kernel.inputs, kernel.outputs
    pattern = re.compile(rf"\b{bodies.name}\[(\d+)\]")
    return {
        "equation": kernel.equation,
        "input": source.name,
        "output": result.name,
        "body": [pattern.sub(place, line) for line in c_body(kernel)],
    }


def _convex(kernels: KernelsByName) -> dict[str, Any]:
    """Sizes for the convex estimators."""
    (body,), (pi,) = kernels["barrier"].inputs, kernels["base_parameters"].inputs
    return {"parameters": body.size, "links": pi.size // body.size}


def _online(kernels: KernelsByName) -> dict[str, Any]:
    """Sizes of the state of the online estimator."""
    sizes = _convex(kernels)
    joints, base = kernels["base_regressor"].outputs[0].shape
    width = -(-sizes["links"] * sizes["parameters"] // 8) * 8
    return sizes | {"joints": joints, "base": base, "width": width}


def _excitation(kernels: KernelsByName, tiles: Tiles) -> dict[str, Any]:
    """Filled rows of the base regressor by 4 × 4 blocks of the Gram matrix."""
    (output,) = kernels["base_regressor"].outputs
    joints, columns = output.shape
    program, adjoint = tiles["base_regressor"], tiles["regressor_adjoint"]
    written = program.filled[output.name]
    filled = [sorted(k % columns for k in written if k // columns == j) for j in range(joints)]
    blocks = [{c // _SIDE for c in row} for row in filled]
    shared: list[int] = []
    ends: list[int] = []
    for i, j in combinations_with_replacement(range(-(-columns // _SIDE)), 2):
        shared += [row for row in range(joints) if {i, j} <= blocks[row]]
        ends.append(len(shared))
    return {
        "joints": joints,
        "columns": columns,
        # first column and one past the last
        "spans": [(row[0], row[-1] + 1) if row else (0, 0) for row in filled],
        "block_ends": ends,
        "block_joints": shared or [0],
        "base_turns_more": not set(program.turns) <= set(adjoint.turns),
    }


def _example(facts: dict[str, Any]) -> dict[str, Any]:
    """A state of the robot, its parameters and its joints; Python's shortest digits are valid C."""
    base = [0.0] * (6 if facts.get("floating") else 0)  # at the origin of the world, upright
    signs = [(-1.0) ** k for k in range(len(base) + len(facts["joints"]))]
    return {
        "joints": signs,
        "bodies": facts.get("all_joints", facts["joints"]),
        "pi0": [float(x) for x in facts["pi0"]],
        "home": [*base, *(float(x) for x in facts["home"])],
        "dq": [0.5 * sign for sign in signs],
        "ddq": [2.0 * sign for sign in signs],
    }


def eliminate(pattern: Sequence[Sequence[bool]], count: int) -> tuple[Panel, ...]:
    """Panels of the first columns of a 0/1 pattern, left to right."""
    filled = [{c for c, here in enumerate(row) if here} for row in pattern]
    panels: list[Panel] = []
    for c in range(count):
        rows = tuple(i for i, row in enumerate(filled) if c in row)
        if not rows:
            continue
        # Column c is eliminated from its rows; they all get the union of their entries beyond c.
        right = {j for i in rows for j in filled[i] if j > c}
        for i in rows:
            filled[i] = set(right)
        # Column c joins the panel before it if the rows agree and that panel changes c and `right`.
        last = panels[-1] if panels else None
        if (
            last is not None
            and last.width < PANEL
            and last.first + last.width == c
            and last.rows == rows
            and last.columns == (c, *sorted(right))
        ):
            panels[-1] = Panel(last.first, last.width + 1, rows, tuple(sorted(right)))
        else:
            panels.append(Panel(c, 1, rows, tuple(sorted(right))))
    return tuple(panels)


def fill_in(pattern: Sequence[Sequence[bool]], panels: Sequence[Panel]) -> list[tuple[int, int]]:
    """Entries that are zero in the pattern and filled by some elimination."""
    touched = {
        (i, c)
        for panel in panels
        for i in panel.rows
        for c in (*range(panel.first, panel.first + panel.width), *panel.columns)
    }
    return sorted((i, c) for i, c in touched if not pattern[i][c])


def shared_columns(pattern: Sequence[Sequence[bool]]) -> tuple[Run, ...]:
    """Columns of a 0/1 pattern whose products with later columns are not zero."""
    count = len(pattern[0])
    rows = [tuple(i for i, row in enumerate(pattern) if row[c]) for c in range(count)]
    runs: list[Run] = []
    for c in range(count):
        if not rows[c]:
            continue
        if runs and runs[-1].first + runs[-1].width == c and rows[c] == rows[c - 1]:
            runs[-1] = replace(runs[-1], width=runs[-1].width + 1)
            continue
        ranges: list[Range] = []
        for j in range(c, count):
            common = tuple(i for i in rows[c] if i in rows[j])
            if ranges and ranges[-1].end == j and ranges[-1].rows == common:
                ranges[-1] = replace(ranges[-1], end=j + 1)
            elif common:
                ranges.append(Range(j, j + 1, common))
        runs.append(Run(c, 1, tuple(ranges)))
    return tuple(runs)
