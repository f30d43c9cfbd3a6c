"""A new unit takes the friction model that the units of its fleet share."""

import json
from pathlib import Path

import pytest

from runtime.library import Library
from tests.runtime.conftest import Command

PRIOR = """
[fleet]
units = 3

[friction]
coulomb_speed = 0.04
[friction.fr3_joint1]
viscous = [0.5, 0.1]
coulomb = [0.3, 0.1]
stribeck = [0.0, 0.1]
"""


@pytest.mark.parametrize(
    ("words", "columns"),
    [((), ["viscous", "coulomb", "stribeck"]), (("--friction", "viscous"), ["viscous"])],
)
def test_the_friction_model_of_the_fleet_is_the_default(
    words: tuple[str, ...],
    columns: list[str],
    command: Command,
    lib: Library,
    log: Path,
    tmp_path: Path,
) -> None:
    """Property: without --friction its columns and widths are fitted; --friction decides else."""
    (tmp_path / "fleet.toml").write_text(PRIOR)
    ran = command(
        *("identify", log, "--robot", lib.folder, "--prior", "fleet.toml", *words),
        *("--settings", "refit=false", "--settings", "report=false", "--out", "new", "--verbose"),
    )
    assert ran.code == 0, ran.err
    friction = json.loads((tmp_path / "new" / "result.json").read_text())["friction"]
    assert friction["columns"] == columns
    if not words:
        assert friction["coulomb_speed"] == 0.04
        assert "the friction model is that of the fleet: viscous, coulomb, stribeck" in ran.out
