"""Builds of the pendulum, and its folder before and after them."""

import ctypes
from collections.abc import Sequence
from pathlib import Path

import symgen
from runtime.library import load
from symgen.make.compiler import Compiled, how_to_compile
from symgen.make.compiler import compile_library as compiled
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.robots import ONE_LEVEL


def compile_library(
    sources: list[Path],
    target: Path,
    per_level: Sequence[Path] = (),
    unhurried: Sequence[Path] = (),
    wanted: Sequence[str] = (),
) -> Compiled:
    """Compile sources into one library."""
    kinds = [[path.name for path in paths] for paths in (sources, per_level, unhurried)]
    return compiled(target.parent, how_to_compile(*kinds), wanted, target)


def snapshot(folder: Path) -> dict[str, tuple[bytes, int]]:
    """Bytes and modification time of every file, lock files aside."""
    return {
        path.relative_to(folder).as_posix(): (path.read_bytes(), path.stat().st_mtime_ns)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.endswith(".lock")
    }


def heavier(request: BuildRequest, kilograms: str = "2.5") -> BuildRequest:
    return BuildRequest(request.name, request.urdf.replace('"1.5"', f'"{kilograms}"'))


def rebuild(request: BuildRequest, root: Path) -> bool:
    """Builds; whether there was anything to do."""
    return build(request, root, levels=ONE_LEVEL).rebuilt


def mass(folder: Path) -> float:
    """Mass that the library really computes with: τ at rest, arm level, is 0.1 m g."""
    lib = load(folder)
    return float(lib.inverse_dynamics([0.0], [0.0], [0.0], lib.pi0)[0] / (-9.81 * 0.1))


def with_headers(folder: Path, driver: str, *headers: str) -> ctypes.CDLL:
    """C text that includes headers of `templates/`, compiled once per level."""
    for name in headers:
        text = (Path(symgen.__file__).parent / "templates" / name).read_text(encoding="utf-8")
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "driver.c").write_text(driver, encoding="utf-8")
    (folder / "nothing.c").write_text("int nothing;\n", encoding="utf-8")
    compile_library([folder / "nothing.c"], folder / "driver.so", [folder / "driver.c"])
    return ctypes.CDLL(str(folder / "driver.so"))
