"""The run behind `scripts/check_models`: each URDF built, held against Pinocchio, inspected.

The robots and how to build them are those of the tests (`tests.robots`), so is the oracle.
"""

import json
import shutil
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.front import Sheet
from runtime.library import Library, load, to_pinocchio_order
from symgen.errors import SymgenError
from symgen.inspect.inspection import inspect_file
from symgen.make.pipeline import build
from tests.oracle import Array, ask_pinocchio, pinocchio_model, with_parameters
from tests.robots import CASES, DATA, MORE, Case

STATES = 300
ALLOWED = 1e-12
"""Tolerance relative to the largest entry, as in tests/symgen/mechanics/test_dynamics.py."""


@dataclass(frozen=True, slots=True)
class Row:
    """One robot; one that cannot be built has a sentence only."""

    name: str
    sentence: str = ""
    joints: int = 0
    base: int = 0
    expected: int = 0
    kept: float = 0.0  # smallest singular value of β
    dropped: float = 0.0  # largest of the rest
    seconds: float = 0.0  # of the build, with one level
    error: float = 0.0  # largest difference to Pinocchio in τ, Y and M over the largest entry
    verdict: str = ""  # of `symgen inspect`

    @property
    def is_right(self) -> bool:
        """Built, with the base parameters that are known for it, and equal to Pinocchio."""
        return not self.sentence and self.error <= ALLOWED and self.base == self.expected


def study(models: Path, names: list[str]) -> Iterator[Row]:
    """A row for each of the named robots, or for all."""
    for name, case in (CASES | MORE).items():
        if not names or name in names:
            folder = Path(tempfile.mkdtemp(prefix="check_models."))
            try:
                yield _row(name, case, models, folder)
            finally:
                shutil.rmtree(folder, ignore_errors=True)


def sheet(rows: list[Row]) -> Sheet:
    """One line per robot."""
    head = ("robot", "joints", "base", "kept ≥", "dropped <", "build s", "error", "inspect")
    lines = []
    for row in rows:
        base = str(row.base) if row.base == row.expected else f"{row.base}, not {row.expected}"
        facts = (str(row.joints), base, f"{row.kept:.2g}", f"{row.dropped:.0e}")
        facts = (*facts, f"{row.seconds:.1f}", f"{row.error:.1e}", row.verdict)
        lines.append((row.name, *((*[""] * 6, row.sentence) if row.sentence else facts)))
    title = f"one level, {STATES} states, error against Pinocchio in τ, Y, M"
    return Sheet("", head, lines, rows, title)


def _row(name: str, case: Case, models: Path, folder: Path) -> Row:
    try:
        request = case.request(name, models)
        start = time.perf_counter()
        built = build(request, folder, levels=["portable"])
        seconds = time.perf_counter() - start
    except SymgenError as error:
        return Row(name, sentence=str(error))
    lib = load(built.folder)
    facts = json.loads((built.folder / "manifest.json").read_text(encoding="utf-8"))
    base = facts["base_parameters"]
    path = (models if case.published else DATA) / case.file
    return Row(
        name,
        joints=lib.n_joints,
        base=len(lib.base_columns),
        expected=case.base_parameters,
        kept=base["smallest_kept"],
        dropped=base["largest_dropped_below"],
        seconds=seconds,
        error=difference(lib),
        verdict=_verdict(path),
    )


def difference(lib: Library) -> float:
    """Largest difference to Pinocchio in τ, Y and M, each over its largest entry."""
    model = with_parameters(pinocchio_model(lib.urdf(), lib.gravity), lib, lib.pi0)
    a = ask_pinocchio(model, lib, STATES)
    pairs = (
        (lib.inverse_dynamics(a.q, a.dq, a.ddq, lib.pi0), a.tau),
        (to_pinocchio_order(lib.regressor(a.q, a.dq, a.ddq)), a.regressor),
        (lib.mass_matrix(a.q, lib.pi0), a.mass),
    )
    return max(_relative(ours, theirs) for ours, theirs in pairs)


def _relative(ours: Array, theirs: Array) -> float:
    return float(np.abs(ours - theirs).max() / np.abs(theirs).max())


def _verdict(path: Path) -> str:
    try:
        inspection = inspect_file(path, with_base=False)
    except SymgenError as error:
        return str(error)
    kinds = [f"{finding.severity}: {finding.kind}" for finding in inspection.findings]
    return ", ".join(f"{kind} ×{kinds.count(kind)}" for kind in dict.fromkeys(kinds)) or "fine"
