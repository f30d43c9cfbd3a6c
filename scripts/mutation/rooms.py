"""Rooms that can be mutated: their sources, and the tests that touch them, fastest first."""

from dataclasses import dataclass
from pathlib import Path

_T = "tests/runtime"
_E = "runtime/estimators"


@dataclass(frozen=True, slots=True)
class Room:
    """Sources and tests, paths from the root of the repository; a folder stands for its files."""

    sources: tuple[str, ...]
    tests: tuple[str, ...]

    def files(self, root: Path) -> list[Path]:
        """Return the source files below `root`, sorted."""
        found: list[Path] = []
        for source in self.sources:
            path = root / source
            found += [path] if path.is_file() else path.rglob("*.py")
        return sorted(set(found))


ROOMS = {
    "convex": Room((f"{_E}/convex",), (f"{_T}/estimators/convex",)),
    "descent": Room(
        (f"{_E}/descent",),
        (f"{_T}/estimators/descent", f"{_T}/identification/test_single_log.py"),
    ),
    "uncertainty": Room(
        (f"{_E}/uncertainty.py",),
        (
            f"{_T}/estimators/test_uncertainty.py",
            f"{_T}/estimators/convex/test_map_estimate.py",
            f"{_T}/identification/test_result_file.py",
        ),
    ),
    "regression": Room(
        (f"{_E}/regression",),
        (f"{_T}/estimators/regression", f"{_T}/estimators/convex/test_map_estimate.py"),
    ),
    "preprocessing": Room(("runtime/recording/preprocessing",), (f"{_T}/recording/preprocessing",)),
    "certificates": Room(("runtime/excitation/proof",), (f"{_T}/excitation/proof",)),
    "excitation": Room(
        ("runtime/excitation/limits", "runtime/excitation/motion", "runtime/excitation/search"),
        (f"{_T}/excitation",),
    ),
    "inspection": Room(("runtime/inspection",), (f"{_T}/inspection",)),
    "payload": Room(("runtime/identification/payload",), (f"{_T}/identification/payload",)),
    "gains": Room(("runtime/identification/sensor_gains",), (f"{_T}/identification/sensor_gains",)),
    "export": Room(("runtime/outputs/model_files",), (f"{_T}/outputs/model_files",)),
    "experiments": Room(("runtime/experiments",), (f"{_T}/experiments",)),
    "mechanics": Room(
        ("symgen/mechanics",), ("tests/symgen/mechanics", "tests/symgen/test_models.py")
    ),
    "emit": Room(
        ("symgen/emit",),
        (
            "tests/symgen/test_tile_program.py",
            "tests/symgen/test_elimination.py",
            "tests/symgen/test_schedule.py",
            "tests/symgen/test_emit.py",
        ),
    ),
    "convex.c": Room(
        ("symgen/templates/convex.c.jinja2",),
        (f"{_T}/estimators/convex/test_convex_compiled.py",),
    ),
    "descent.c": Room(
        ("symgen/templates/descent.c.jinja2",), (f"{_T}/estimators/descent/test_descent.py",)
    ),
}
