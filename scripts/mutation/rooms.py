"""Rooms that can be mutated: their sources, and the folders of their tests."""

from dataclasses import dataclass
from pathlib import Path

_T = "tests/runtime"
_E = "runtime/estimators"


@dataclass(frozen=True, slots=True)
class Room:
    """Sources and tests, paths from the root of the repository; a folder stands for its files.

    Attributes:
        sources: files and folders.
        tests: files and folders.
        robots: parts of the names of the tests that count, where others compile for long.
    """

    sources: tuple[str, ...]
    tests: tuple[str, ...]
    robots: tuple[str, ...] = ()

    def files(self, root: Path) -> list[Path]:
        """Return the source files below `root`, sorted."""
        found: list[Path] = []
        for source in self.sources:
            path = root / source
            found += [path] if path.is_file() else path.rglob("*.py")
        return sorted(set(found))


_CONVEX = f"{_E}/convex"
_POSTERIOR = tuple(
    f"{_CONVEX}/{name}.py"
    for name in ("map_estimate", "posterior_spread", "entropic_prior", "prior_test")
)
_MECHANICS = "symgen/mechanics"
_TEMPLATES = "symgen/templates"
SMALL = ("double",)
"""Robots of tests that build in seconds."""

ROOMS = {
    "convex": Room(
        tuple(
            f"{_CONVEX}/{name}.py"
            for name in (
                *("__init__", "bodies", "compiled", "constraints", "eliminate_friction"),
                *("newton", "path"),
            )
        ),
        (f"{_T}/estimators/convex",),
    ),
    "posterior": Room(
        (*_POSTERIOR, f"{_E}/armature_prior.py", f"{_E}/type_prior.py"),
        (f"{_T}/estimators/convex", f"{_T}/estimators/test_armature_prior.py"),
    ),
    "descent": Room((f"{_E}/descent",), (f"{_T}/estimators/descent",)),
    "uncertainty": Room(
        (f"{_E}/uncertainty.py", f"{_E}/laplace.py"), (f"{_T}/estimators/test_uncertainty.py",)
    ),
    "residuals": Room(
        tuple(
            f"{_E}/regression/{name}.py"
            for name in ("residuals", "samples", "torque_objective", "score_test", "friction_test")
        ),
        (f"{_T}/estimators/regression",),
    ),
    "coloured noise": Room(
        (f"{_E}/regression/coloured_noise.py", f"{_E}/regression/compression.py"),
        (f"{_T}/estimators/regression",),
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
    "dynamics": Room(
        tuple(
            f"{_MECHANICS}/{name}.py"
            for name in (
                *("dynamics", "mass_matrix", "kinematics", "spatial", "passive", "excitation"),
                "loop_equations",
            )
        ),
        ("tests/symgen/mechanics",),
    ),
    "inertia": Room((f"{_MECHANICS}/inertia.py",), ("tests/symgen/mechanics",)),
    "base parameters": Room((f"{_MECHANICS}/base_parameters.py",), ("tests/symgen/mechanics",)),
    "emit": Room(
        ("symgen/emit",),
        (
            *(
                f"tests/symgen/test_{name}.py"
                for name in (
                    *("emit", "emit_manifest", "composition", "elimination", "schedule", "stack"),
                    *("tile_program", "parts", "tiles", "lanes", "objects", "memory"),
                )
            ),
            f"{_T}/estimators/convex/test_convex_compiled.py",
            f"{_T}/estimators/descent/test_descent.py",
            f"{_T}/estimators/regression/test_factor.py",
            f"{_T}/excitation/search/test_condition_cost.py",
        ),
    ),
    "convex.c": Room(
        (f"{_TEMPLATES}/convex.c.jinja2",),
        (f"{_T}/estimators/convex/test_convex_compiled.py",),
        SMALL,
    ),
    "descent.c": Room(
        (f"{_TEMPLATES}/descent.c.jinja2",),
        (f"{_T}/estimators/descent/test_descent.py",),
        SMALL,
    ),
    "statistics.c": Room(
        tuple(f"{_TEMPLATES}/{name}" for name in ("statistics.c.jinja2", "gram.h", "fold.h")),
        (
            f"{_T}/estimators/regression/test_factor.py",
            f"{_T}/estimators/regression/test_products.py",
        ),
        SMALL,
    ),
    "excitation.c": Room(
        (f"{_TEMPLATES}/excitation.c.jinja2", f"{_TEMPLATES}/eigen.h"),
        (f"{_T}/excitation/search/test_condition_cost.py",),
        SMALL,
    ),
}
