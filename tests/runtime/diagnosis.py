"""Findings of an inspection, for its tests."""

from pathlib import Path

from runtime.inspection import ERROR, WARNING, Inspection, inspect_log, recipe_text
from runtime.library import Library

EXAMPLE = Path(__file__).parents[2] / "runtime" / "examples" / "fr3_simulated.npz"


def sentences(inspection: Inspection) -> dict[str, str]:
    """Kinds of warnings and errors → their sentences."""
    return {f.kind: f.sentence for f in inspection.of_level(ERROR, WARNING)}


def kinds(inspection: Inspection) -> set[str]:
    """Kinds of all findings."""
    return {f.kind for f in inspection.findings}


def require_no_warning(inspection: Inspection, log: Path, lib: Library, tmp_path: Path) -> None:
    """Read with the proposed recipe, the log causes no warning or error."""
    recipe = tmp_path / "proposed.toml"
    recipe.write_text(recipe_text(inspection), encoding="utf-8")
    assert sentences(inspect_log(log, lib, recipe)) == {}
