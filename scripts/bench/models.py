"""The run behind `scripts/check_models`: each URDF built, held against Pinocchio, inspected.

The robots and how to build them are those of the tests (`tests.robots`), so is the oracle.
"""

import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bench.front import Sheet, cpu_seconds, sheet_of
from runtime.common.files import json_of
from runtime.library import Library, load, to_pinocchio_order
from symgen.errors import SymgenError
from symgen.inspect.inspection import inspect_file
from symgen.make.pipeline import build
from tests.oracle import ask_pinocchio, pinocchio_model, with_parameters
from tests.robots import CASES, DATA, MORE, ONE_LEVEL, Case

STATES = 300
ALLOWED = 1e-12
"""Tolerance relative to the largest entry, as in tests/symgen/mechanics/test_dynamics.py."""
COLUMNS = {
    **{"robot": "", "joints": "", "base": "", "expected": "", "kept ≥": ".2g", "dropped <": ".0e"},
    **{"build s": ".1f", "error": ".1e", "inspect": ""},
}
"""Base parameters and those that are known for the robot, singular values of β, CPU time of one
level, largest difference to Pinocchio in τ, Y and M, and verdict of `symgen inspect` or refusal."""


def study(models: Path, names: list[str]) -> Iterator[tuple[Any, ...]]:
    """Values of `COLUMNS` for each of the named robots, or for all."""
    for name, case in (CASES | MORE).items():
        if not names or name in names:
            with tempfile.TemporaryDirectory(prefix="check_models.") as folder:
                yield _row(name, case, models, Path(folder))


def is_right(row: tuple[Any, ...]) -> bool:
    """Built, with the base parameters that are known for it, and equal to Pinocchio."""
    _, _, base, expected, *_, error, _ = row
    return error is not None and error <= ALLOWED and base == expected


def sheet(rows: list[tuple[Any, ...]]) -> Sheet:
    """One line per robot."""
    title = f"one level, {STATES} states, error against Pinocchio in τ, Y, M"
    return sheet_of("", COLUMNS, rows, title=title)


def _row(name: str, case: Case, models: Path, folder: Path) -> tuple[Any, ...]:
    try:
        request = case.request(name, models)
        start = cpu_seconds()
        built = build(request, folder, levels=ONE_LEVEL)
        seconds = cpu_seconds() - start
    except SymgenError as error:
        return (name, *[None] * (len(COLUMNS) - 2), str(error))
    lib, facts = load(built.folder), json_of(built.folder / "manifest.json")["base_parameters"]
    values = (facts["smallest_kept"], facts["largest_dropped_below"], seconds, difference(lib))
    verdict = _verdict((models if case.published else DATA) / case.file)
    return (name, lib.n_joints, len(lib.base_columns), case.base_parameters, *values, verdict)


def difference(lib: Library) -> float:
    """Largest difference to Pinocchio in τ, Y and M, each over its largest entry."""
    model = with_parameters(pinocchio_model(lib.urdf(), lib.gravity), lib, lib.pi0)
    a = ask_pinocchio(model, lib, STATES)
    pairs = (
        (lib.inverse_dynamics(a.q, a.dq, a.ddq, lib.pi0), a.tau),
        (to_pinocchio_order(lib.regressor(a.q, a.dq, a.ddq)), a.regressor),
        (lib.mass_matrix(a.q, lib.pi0), a.mass),
    )
    return max(float(np.abs(x - y).max() / np.abs(y).max()) for x, y in pairs)


def _verdict(path: Path) -> str:
    try:
        findings = inspect_file(path, with_base=False).findings
    except SymgenError as error:
        return str(error)
    kinds = Counter(f"{finding.severity}: {finding.kind}" for finding in findings)
    return ", ".join(f"{kind} ×{count}" for kind, count in kinds.items()) or "fine"
