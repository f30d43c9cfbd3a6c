"""Rooms that can be mutated: their sources, and the folders of their tests."""

from dataclasses import dataclass
from pathlib import Path

_T = "tests/runtime"
_E = "runtime/estimators"
_TEMPLATES = "symgen/templates"
_MECHANICS = ("tests/symgen/mechanics",)


@dataclass(frozen=True, slots=True)
class Room:
    """Sources and tests, paths from the root of the repository; a folder stands for its files."""

    sources: tuple[str, ...]
    tests: tuple[str, ...]
    only: str = ""  # part of the names of the tests that count: of robots that build in seconds

    def files(self, root: Path) -> list[Path]:
        """The source files below `root`, sorted."""
        found: list[Path] = []
        for source in self.sources:
            path = root / source
            found += [path] if path.is_file() else path.rglob("*.py")
        return sorted(set(found))


def _in(folder: str, names: str) -> tuple[str, ...]:
    return tuple(f"{folder}/{name}.py" for name in names.split())


def _c(sources: str, *tests: str) -> Room:
    return Room(tuple(f"{_TEMPLATES}/{name}" for name in sources.split()), tests, "double")


_FACTOR = f"{_T}/estimators/regression/test_factor.py"
_CONVEX = f"{_T}/estimators/convex/test_convex_compiled.py"
_DESCENT = f"{_T}/estimators/descent/test_descent.py"
_COST = f"{_T}/excitation/search/test_condition_cost.py"
_EMIT = _in(
    "tests/symgen",
    "test_emit test_emit_manifest test_composition test_elimination test_schedule test_stack"
    " test_tile_program test_parts test_tiles test_lanes test_memory",
)

ROOMS = {
    "convex": Room(
        _in(f"{_E}/convex", "__init__ compiled constraints eliminate_friction newton path"),
        (f"{_T}/estimators/convex",),
    ),
    "posterior": Room(
        (
            *_in(f"{_E}/convex", "map_estimate entropic_prior prior_agreement"),
            *_in(_E, "prior_file type_prior"),
        ),
        (f"{_T}/estimators/convex", f"{_T}/estimators/test_armature_prior.py"),
    ),
    "descent": Room((f"{_E}/descent",), (f"{_T}/estimators/descent",)),
    "uncertainty": Room(_in(_E, "uncertainty"), (f"{_T}/estimators/test_uncertainty.py",)),
    "residuals": Room(
        _in(f"{_E}/regression", "samples omitted_columns deviation_tests"),
        (f"{_T}/estimators/regression",),
    ),
    "coloured noise": Room(
        _in(f"{_E}/regression", "coloured_noise compression"), (f"{_T}/estimators/regression",)
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
        _in(
            "symgen/mechanics",
            "dynamics mass_matrix kinematics spatial passive excitation loop_equations",
        ),
        _MECHANICS,
    ),
    "inertia": Room(_in("symgen/mechanics", "inertia"), _MECHANICS),
    "base parameters": Room(_in("symgen/mechanics", "base_parameters"), _MECHANICS),
    "emit": Room(("symgen/emit",), (*_EMIT, _CONVEX, _DESCENT, _FACTOR, _COST)),
    "convex.c": _c("convex.c.jinja2", _CONVEX),
    "descent.c": _c("descent.c.jinja2", _DESCENT),
    "statistics.c": _c(
        "statistics.c.jinja2 gram.h fold.h", _FACTOR, f"{_T}/estimators/regression/test_products.py"
    ),
    "excitation.c": _c("excitation.c.jinja2 eigen.h", _COST),
}
