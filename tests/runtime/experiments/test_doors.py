"""The experiments of the document enter the other rooms by listed modules."""

import ast

from tests.conftest import REPOSITORY

USED_BY_EXPERIMENTS = {
    "runtime": ("errors", "excitation", "library", "parallel", "recording", "simulation"),
    "runtime.cli": ("common",),
    "runtime.common": ("commands", "files", "records", "settings", "tables", "terminal", "threads"),
    "runtime.estimators": ("descent.fit", "methods", "optimizers", "problem"),
    "runtime.estimators.literature": ("iv_didim",),
    "runtime.estimators.regression": ("factor", "samples"),
    "runtime.excitation.search": ("design", "design_settings", "single_start"),
    "runtime.identification": ("comparison.run", "metrics", "payload.estimate", "problem_setup"),
    "runtime.library": ("parameters",),
    "runtime.outputs.report": ("canvas", "page"),
    "runtime.outputs": ("report",),
    "runtime.recording": ("formats.npz", "formats.parquet_format", "preprocessing"),
}
"""Room → its modules that the experiments of the document may import; no room imports them."""


def beyond_doors(name: str, tree: ast.Module) -> set[str]:
    """Imports of a module of the experiments from other rooms that are not through their doors."""
    nodes = list(ast.walk(tree))
    froms = [
        (n.module or "", each.name)
        for n in nodes
        if isinstance(n, ast.ImportFrom)
        for each in n.names
    ]
    plain = [(each.name, "") for n in nodes if isinstance(n, ast.Import) for each in n.names]
    doors = {f"{room}.{door}" for room, listed in USED_BY_EXPERIMENTS.items() for door in listed}
    return {
        f"{name}: {module} {taken}"
        for module, taken in froms + plain
        if f"{module}.".startswith("runtime.")
        and not f"{module}.".startswith("runtime.experiments.")
        and (module not in doors or taken.startswith("_"))
    }


def test_experiments_enter_rooms_by_their_doors() -> None:
    """Property: the experiments use listed modules only, and of those no private name."""
    paths = list((REPOSITORY / "runtime/experiments").rglob("*.py"))
    assert paths
    trees = {str(path): ast.parse(path.read_text(encoding="utf-8")) for path in paths}
    assert set().union(*(beyond_doors(*each) for each in trees.items())) == set()
    inside = "from runtime.monitoring.drift import watch\nfrom runtime.library import _x\n"
    inside += "import runtime.cli.watch\nfrom runtime.library import load\n"
    assert len(beyond_doors("x", ast.parse(inside))) == 3
