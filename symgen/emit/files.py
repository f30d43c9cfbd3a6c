"""Kernels → C, header, manifest, README: text only; equal input gives equal bytes.

The files come from `templates/`, which hold loops and names, never maths.
"""

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from symgen.emit.elimination import eliminate, fill_in
from symgen.emit.ssa import TileProgram, c_body, tile_program
from symgen.kernel import Argument, Kernel

_TEMPLATES = Path(__file__).parents[1] / "templates"

IDENTIFICATION = frozenset(("loss_gradient", "pi_from_lam", "pi_adjoint"))
"""Kernels with which a descent in λ can be written out in C."""


@dataclass(frozen=True, slots=True)
class EmittedRobot:
    """File name → text of one generated folder, and the hash that ties library and manifest."""

    files: dict[str, str]
    model_hash: str


def emit(
    name: str, kernels: tuple[Kernel, ...], facts: dict[str, Any], versions: dict[str, str]
) -> EmittedRobot:
    """Render every file of a generated folder.

    Args:
        name: C prefix and folder name.
        kernels: in the order in which they appear in the files.
        facts: the model's own part of the manifest, JSON-ready.
        versions: tool → version, for the banner and the manifest.
    """
    bodies = {kernel.name: c_body(kernel) for kernel in kernels}
    tiles = {kernel.name: tile_program(kernel) for kernel in kernels}
    manifest = {
        "format": 1,
        "robot": name,
        "versions": versions,
        **facts,
        "kernels": [_kernel_entry(kernel) for kernel in kernels],
    }
    digest = hashlib.sha256()
    digest.update(json.dumps(manifest, sort_keys=True).encode())
    digest.update(json.dumps(bodies, sort_keys=True).encode())
    digest.update(repr(tiles).encode())
    manifest["model_hash"] = digest.hexdigest()
    context: dict[str, Any] = {
        "name": name,
        "kernels": kernels,
        "bodies": bodies,
        "tiles": tiles,
        "manifest": manifest,
        "versions": versions,
        "identifies": bodies.keys() >= IDENTIFICATION,
    }
    regressor = next((k for k in kernels if k.name == "base_regressor"), None)
    if regressor is not None:
        context |= _elimination(regressor, tiles[regressor.name])
    render = _renderer()
    files = {
        "manifest.json": json.dumps(manifest, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
        "kernels.c": render("kernels.c.jinja2", context),
        "lanes.h": (_TEMPLATES / "lanes.h").read_text(encoding="utf-8"),
        "tiles.h": render("tiles.h.jinja2", context),
        "tiles.c": render("tiles.c.jinja2", context),
        f"{name}.h": render("header.h.jinja2", context),
        "README.md": render("README.md.jinja2", context),
    }
    if regressor is not None:
        files["statistics.c"] = render("statistics.c.jinja2", context)
        files["update.c"] = render("update.c.jinja2", context)
    return EmittedRobot(files, manifest["model_hash"])


def _elimination(regressor: Kernel, tile: TileProgram) -> dict[str, Any]:
    """Tables of the rows [Y_b tau] for the templates that eliminate them."""
    joints, base = regressor.outputs[0].shape
    entries = {divmod(index, base) for index in tile.filled[regressor.outputs[0].name]}
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
    runs = [_run([c for c in range(base) if row[c]]) for row in pattern]
    per_joint = [[c for c in range(base + 1) if row[c]] for row in pattern]
    return {
        "joints": joints,
        "base": base,
        "turned": tile.turned,
        "panels": placed,
        "row_table": rows,
        "column_table": columns,
        "runs": runs,
        "cleared": [
            (i, c) for i, c in fill_in(pattern, panels) if not runs[i][0] <= c < runs[i][1]
        ],
        "joint_table": [c for row in per_joint for c in row],
        "joint_at": [sum(map(len, per_joint[:i])) for i in range(joints + 1)],
    }


def _run(columns: list[int]) -> tuple[int, int]:
    """From the first to behind the last of them."""
    return (columns[0], columns[-1] + 1) if columns else (0, 0)


def _kernel_entry(kernel: Kernel) -> dict[str, Any]:
    def arguments(items: tuple[Argument, ...]) -> list[dict[str, Any]]:
        return [
            {"name": a.name, "shape": list(a.shape), "unit": a.unit}
            | ({"summed": True} if a.summed else {})
            | ({"shared": True} if a.shared else {})
            for a in items
        ]

    return {
        "name": kernel.name,
        "per": kernel.per,
        "equation": kernel.equation,
        "inputs": arguments(kernel.inputs),
        "outputs": arguments(kernel.outputs),
        "operations": kernel.operations,
    }


def _renderer() -> Callable[[str, dict[str, Any]], str]:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # noqa: S701  C and Markdown, not HTML
    )
    environment.tests["idle_in"] = lambda name, lines: (
        not any(re.search(rf"\b{name}\[", line) for line in lines)
    )
    return lambda template, context: environment.get_template(template).render(context)
