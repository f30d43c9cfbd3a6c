"""C sources → shared library: choice of the compiler, its error messages, the exact commands."""

import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from symgen.build.compile_recipe import (
    FLAGS,
    LEVELS,
    LINK,
    PORTABLE,
    REFERENCE,
    how_to_compile,
)
from symgen.errors import CompilerError

if TYPE_CHECKING:
    from symgen.build.objects import Objects


@dataclass(frozen=True, slots=True)
class Compiled:
    """Commands that were run, version of the compiler, and hash of the library."""

    commands: tuple[tuple[str, ...], ...]
    version: str
    sha256: str


def find_compiler() -> tuple[str, ...]:
    """Command of the C compiler: $CC, else cc, gcc or clang of the PATH, else the ziglang wheel."""
    variable = shlex.split(os.environ.get("CC", ""))
    if variable:
        if shutil.which(variable[0]) is None:
            raise CompilerError(
                f"$CC names the compiler '{variable[0]}', which is not on the PATH; "
                "install it or unset CC"
            )
        return tuple(variable)
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return (name,)
    if importlib.util.find_spec("ziglang"):
        # -P: the compiler runs in a generated folder, whose ziglang.py is not the wheel. Zig tests
        # for undefined behaviour unless it optimises, and first compiles a library for that, 18 s.
        return (sys.executable, "-P", "-m", "ziglang", "cc", "-fno-sanitize=undefined")
    raise CompilerError(
        "no C compiler found (looked for $CC, cc, gcc, clang and the ziglang wheel); "
        "install one, for example with: pip install ziglang"
    )


def compile_library(
    sources: list[Path],
    target: Path,
    per_level: Sequence[Path] = (),
    unhurried: Sequence[Path] = (),
    wanted: Sequence[str] = (),
) -> Compiled:
    """Compile sources into one library."""
    kinds = [[path.name for path in paths] for paths in (sources, per_level, unhurried)]
    with Compilation(target.parent, how_to_compile(*kinds), wanted) as compilation:
        return compilation.finish([name for kind in kinds for name in kind], target)


class Compilation:
    """Compilation of the files of a folder on all cores, each as soon as it is written.

    Leaving the context waits for running commands and cancels the others.

    Args:
        folder: where the sources are or will be, and where objects are written.
        how: from `how_to_compile`.
        wanted: as in `compile_library`.
        objects: what earlier builds have compiled; None compiles all.

    Raises:
        CompilerError: no compiler, or an unsupported level is requested.
    """

    def __init__(
        self,
        folder: Path,
        how: dict[str, Any],
        wanted: Sequence[str] = (),
        objects: "Objects | None" = None,
    ) -> None:
        self._folder, self._compiler, self._objects = folder, find_compiler(), objects
        _require_levels(wanted)
        self._units: dict[str, list[tuple[str, list[str]]]] = {}
        has_better = False  # levels are listed from the best on
        spared = {tuple(group["gcc"]) for group in how["groups"]}  # only GCC accepts them
        spared = {flags for flags in spared if _accepts(self._compiler, flags)}
        for group in how["groups"]:
            level, is_here = group["level"], group["machine"] in {"", machine()}
            if not is_here or (wanted and level and level not in wanted):
                continue
            flags = [_spelled(flag, self._compiler) for flag in group["flags"]]
            if not _accepts(self._compiler, [f for f in flags if f.startswith("-march=")]):
                if wanted:
                    raise CompilerError(
                        f"'{shlex.join(self._compiler)}' cannot compile for the level '{level}'; "
                        "leave it out or install a newer compiler"
                    )
                continue  # an older compiler; the loader takes the best of the others
            flags += group["gcc"] if tuple(group["gcc"]) in spared else []
            flags += group["beside"] if has_better else []
            has_better |= bool(level)
            for name in group["sources"]:
                unit = f"{Path(name).stem}_{level}.o" if level else f"{Path(name).stem}.o"
                self._units.setdefault(name, []).append((unit, flags))
        self._pool = ThreadPoolExecutor(os.cpu_count())
        self._running: dict[tuple[str, ...], Future[None]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def start(self, name: str) -> None:
        """Compile a complete file in the background, for every level that it belongs to."""
        for unit, flags in self._units.get(name, []):
            command = (*self._compiler, *FLAGS, *flags, "-c", name, "-o", unit)
            if command not in self._running:
                self._running[command] = self._pool.submit(self._compile, command)

    def _compile(self, command: tuple[str, ...]) -> None:
        source, unit = (self._folder / command[at] for at in (-3, -1))
        flags = command[len(self._compiler) : -4]
        if self._objects is None:
            _run(command, self._folder)
        elif not self._objects.restore(source, flags, unit):
            _run(command, self._folder)
            self._objects.keep(source, flags, unit)

    def finish(self, names: Sequence[str], target: Path) -> Compiled:
        """Compile the remaining files, the longest first, and link them."""
        for name in sorted(names, key=lambda name: -(self._folder / name).stat().st_size):
            self.start(name)
        for future in self._running.values():
            future.result()
        objects = [command[-1] for command in self._running]
        link = (*self._compiler, "-o", target.name, *objects, *LINK)
        _run(link, self._folder)
        for unit in objects:
            (self._folder / unit).unlink()
        version = compiler_version(self._compiler)
        return Compiled((*self._running, link), version, sha256_of(target))


def level_names() -> tuple[str, ...]:
    """Every level that can be compiled on this machine, the best first."""
    return (*LEVELS.get(machine(), PORTABLE), REFERENCE)


def _require_levels(wanted: Sequence[str]) -> None:
    for name in wanted:
        if name not in level_names():
            raise CompilerError(
                f"there is no level '{name}' on {machine()}; its levels are "
                f"{', '.join(level_names())}"
            )
    if wanted and not set(wanted) - {REFERENCE}:
        raise CompilerError(
            f"'{REFERENCE}' is only the reference of the other levels; "
            f"add one of {', '.join(level_names()[:-1])}"
        )


def machine() -> str:
    """Architecture of this machine: x86_64, aarch64, or the name that the system gives."""
    name = platform.machine().lower()
    return {"amd64": "x86_64", "arm64": "aarch64"}.get(name, name)


def _spelled(flag: str, compiler: tuple[str, ...]) -> str:
    """The flag as this compiler writes it: zig spells instruction sets with underscores."""
    if not flag.startswith("-march=") or "ziglang" not in compiler:
        return flag
    return f"-march={flag.removeprefix('-march=').replace('-', '_')}"


def _accepts(compiler: tuple[str, ...], flags: Sequence[str]) -> bool:
    """True if the compiler supports all these flags."""
    return not flags or _probed(compiler, tuple(flags), *_identity(compiler))


def _identity(compiler: tuple[str, ...]) -> tuple[str, float]:
    """The program behind a command and its date: a new one has its own answers."""
    path = shutil.which(compiler[0]) or compiler[0]
    return path, os.stat(path).st_mtime if os.path.exists(path) else 0.0


@cache
def _probed(compiler: tuple[str, ...], flags: tuple[str, ...], *_: object) -> bool:
    probe = [*compiler, "-Werror", *flags, "-x", "c", "-E", os.devnull]
    return subprocess.run(probe, capture_output=True, check=False).returncode == 0


def accepts_level(compiler: tuple[str, ...], level: str) -> bool:
    """Return whether a compiler knows the instruction set of a level."""
    _, architecture = LEVELS.get(machine(), PORTABLE)[level]
    return not architecture or _accepts(compiler, [_spelled(f"-march={architecture}", compiler)])


def _run(command: tuple[str, ...], folder: Path) -> None:
    target = folder / command[command.index("-o") + 1]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode != 0 or not target.exists():
        message = "\n".join(run.stderr.strip().splitlines()[:20])
        if not message:
            state = f"with exit status {run.returncode}" if run.returncode else "without its output"
            message = f"it ended {state} and no message; check the compiler that $CC names"
        raise CompilerError(f"'{shlex.join(command)}' failed:\n{message}")


def compiler_version(compiler: tuple[str, ...]) -> str:
    """First line of the compiler's `--version`."""
    run = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False)
    return run.stdout.strip().splitlines()[0] if run.stdout.strip() else "unknown"


def sha256_of(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
