"""Rooms that can be mutated: their sources, and the tests that they meet."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Room:
    """Patterns of sources and tests from the root of the repository; a folder is all its files."""

    sources: tuple[str, ...]
    tests: tuple[str, ...]
    only: str = ""  # part of the names of the tests that count: of robots that build in seconds

    def files(self, root: Path) -> list[Path]:
        """The source files below `root`, sorted."""
        found = [path for source in self.sources for path in root.glob(source)]
        inside = [file for path in found for file in path.rglob("*.py")]
        return sorted({path for path in (*found, *inside) if path.is_file()})

    def test_files(self, root: Path) -> list[str]:
        """Folders and files of the tests, from `root`."""
        return [str(p.relative_to(root)) for test in self.tests for p in sorted(root.glob(test))]


def _same(*places: str) -> Room:
    """Folders of runtime whose tests have the same names."""
    return Room(
        tuple(f"runtime/{place}" for place in places),
        tuple(f"tests/runtime/{place}" for place in places),
    )


def _c(sources: str, *tests: str) -> Room:
    places = tuple(f"symgen/templates/{name}" for name in sources.split())
    return Room(places, tuple(f"tests/runtime/{test}.py" for test in tests), "double")


ROOMS = {
    "convex": _same("estimators/convex"),
    "descent": _same("estimators/descent"),
    "regression": _same("estimators/regression"),
    "estimators": Room(("runtime/estimators/*.py",), ("tests/runtime/estimators/test_*.py",)),
    "preprocessing": _same("recording/preprocessing"),
    "certificates": _same("excitation/proof"),
    "excitation": _same("excitation/limits", "excitation/motion", "excitation/search"),
    "inspection": _same("inspection"),
    "payload": _same("identification/payload"),
    "gains": Room(
        ("runtime/identification/sensor_gains.py",), ("tests/runtime/identification/sensor_gains",)
    ),
    "drives": _same("identification/drive"),
    "free base": Room(
        (
            "runtime/identification/free_base",
            "runtime/recording/free_base.py",
            "runtime/recording/preprocessing/free_base_motion.py",
        ),
        (
            "tests/runtime/identification/test_free_base*.py",
            "tests/runtime/recording/preprocessing/test_free_base_motion.py",
        ),
    ),
    "priors": Room(
        (
            "runtime/estimators/prior_file.py",
            "runtime/estimators/prior_file.py",
            "runtime/estimators/convex/*prior*.py",
            "runtime/estimators/convex/map_estimate.py",
        ),
        (
            "tests/runtime/estimators/convex/test_map_estimate.py",
            "tests/runtime/estimators/test_contradictions.py",
        ),
    ),
    "monitoring": _same("monitoring"),
    "campaign": _same("campaign"),
    "export": _same("outputs/model_files"),
    "experiments": _same("experiments"),
    "mechanics": Room(("symgen/mechanics",), ("tests/symgen/mechanics",)),
    "emit": Room(
        ("symgen/emit",),
        tuple(
            f"tests/symgen/test_{name}.py"
            for name in (
                "emit*",
                "composition",
                "elimination",
                "schedule",
                "stack",
                "lanes",
                "parts",
            )
        ),
    ),
    "convex.c": _c("convex.c.jinja2", "estimators/convex/test_convex_compiled"),
    "descent.c": _c("descent.c.jinja2", "estimators/descent/test_descent"),
    "statistics.c": _c(
        "statistics.c.jinja2 gram.h fold.h",
        *(f"estimators/regression/test_{name}" for name in ("factor", "products")),
    ),
    "excitation.c": _c("excitation.c.jinja2 eigen.h", "excitation/search/test_condition_cost"),
}
