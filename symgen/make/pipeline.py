"""The stages of a build: request → chain → catalogue → files → library → generated/<robot>/.

The folder is replaced as a whole by one atomic exchange, so that concurrent builds, a killed build
and a full disk leave either the old library or the new one.
"""

import ctypes
import filecmp
import hashlib
import os
import shlex
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from filelock import FileLock

from runtime.common.files import json_of, json_text, sha256_of
from runtime.common.user_builds import is_user_build, record_build
from symgen.catalogue import LONG, make_catalogue
from symgen.chain import Chain, read_chain
from symgen.emit.files import controller_files, emit
from symgen.errors import BuildError
from symgen.kernel import Kernel, Kernels
from symgen.make import VERSION
from symgen.make.compiler import PORTABLE, REFERENCE, compile_library, how_to_compile, level_names
from symgen.make.facts import initial_parameters, model_facts, notes_of
from symgen.make.request import BuildRequest
from symgen.mechanics.loop_range import within_loops

_ONCE = (0.45, 4.2e-5)  # sources of no level: seconds, and seconds per instruction
_PER_LEVEL = {
    "v4": (2.5, 3.7e-5),
    "v3": (2.3, 3.9e-5),
    "v2": (2.2, 4.2e-5),
    "neon": (2.2, 4.2e-5),
    "portable": (2.0, 4.2e-5),
    REFERENCE: (0.15, 3.7e-5),
}
_FALLBACK = (0.45, 2e-6)  # the portable level beside a better one
_COMPILER_MB = (55.0, 9e-4)  # memory of one compiler process: MB, and MB per instruction
_PYTHON_MB = (65.0, 6e-4)  # memory of this process while others compile: MB, and MB per instruction


@dataclass(frozen=True, slots=True)
class ExpectedCost:
    """Size of the kernels and what their compilation takes.

    CPU time = Σ over levels (fixed + operations · rate)
    memory of one process = fixed + operations · rate

    Times are fitted to GCC 12 on one x86-64 core with arms of 1 and 7 joints (6188 and 57111
    instructions), which they reproduce to 5 %; other machines differ by their speed. Memory is that
    of this process and of the compilers that run at the same time (proportional set sizes): 153,
    333, 340 and 507 MB for a two-link arm, a Go2, an FR3 and a Talos of 8309, 55516, 55821 and
    189288 instructions, which it reproduces within a factor of 1.3.
    """

    operations: int  # instructions of all kernels
    cpu_s: float  # CPU time of all compilers [s]
    memory_mb: float  # largest memory at one time [MB]
    levels: tuple[str, ...]  # what is compiled, the best first

    def __str__(self) -> str:
        """One sentence for the user."""
        return (
            f"{self.operations} operations; expected {self.cpu_s:.0f} s of CPU and "
            f"{self.memory_mb:.0f} MB of memory for the levels {', '.join(self.levels)}"
        )


_OF_ONE_BUILD = (".so", ".tmp", ".casadi", "_casadi.c")  # ends of files of one build only
_AT_FDCWD = -100
_RENAME_EXCHANGE = 2

ONCE = ("kernels.c", "update.c", "online.c", "closed_loop.c")  # sources compiled once
PER_LEVEL = ("tiles.c", "statistics.c", "descent.c", "convex.c", "excitation.c")
"""Sources compiled once per instruction set."""
UNHURRIED = ("reference.c",)  # sources compiled without optimisation: their speed does not matter
_KINDS = (ONCE, PER_LEVEL, UNHURRIED)


@dataclass(frozen=True, slots=True)
class BuildResult:
    """Outcome of a build."""

    folder: Path  # generated folder
    rebuilt: bool  # False if it was up to date
    notes: tuple[str, ...]  # sentences for the user


def build(
    request: BuildRequest,
    root: Path,
    force: bool = False,
    levels: Sequence[str] = (),
    overwrite: bool = False,
    watch: Callable[[ExpectedCost], None] | None = None,
) -> BuildResult:
    """Generate and compile the library of a robot unless it is up to date."""
    folder = root / request.name
    if not force and is_current(request, folder, levels):
        return BuildResult(folder, False, ())
    draft = _draft(request)  # before any write: a robot that fails here leaves no trace on disk
    if watch is not None:
        watch(expected_cost(draft.kernels, levels))
    with _write_errors(folder):
        root.mkdir(parents=True, exist_ok=True)
        # One build per robot: the operating system drops the lock of a killed build. It follows no
        # link.
        with FileLock(root / f".{request.name}.lock"):
            for stale in root.glob(f".{request.name}.*/"):
                shutil.rmtree(stale, ignore_errors=True)  # left by a killed build
            if not force and is_current(request, folder, levels):  # another process was faster
                return BuildResult(folder, False, draft.notes)
            staging = Path(tempfile.mkdtemp(prefix=f".{request.name}.", dir=root))
            try:
                staging.chmod(0o755)
                sha256 = _fill(staging, request, draft, levels)
                if not overwrite:
                    require_no_foreign_file(staging, folder)
                replace_folder(staging, folder)
            finally:
                shutil.rmtree(staging, ignore_errors=True)
    note = record_build(request.name, folder, sha256)
    return BuildResult(folder, True, (*draft.notes, *filter(None, [note])))


def generate(request: BuildRequest) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return all committed files of a robot as text, and notes for the user."""
    draft = _draft(request)
    return _texts(request, draft), draft.notes


def write_controller(
    request: BuildRequest, root: Path, kernels: Sequence[str], precision: str, overwrite: bool
) -> Path:
    """Write some kernels for a microcontroller to root/NAME/controller, and compile nothing."""
    folder = root / request.name / "controller"
    present = [path for end in ("c", "h") if (path := folder / f"{request.name}.{end}").exists()]
    if present and not overwrite:
        raise BuildError(f"'{present[0]}' exists; choose another --out or give --overwrite")
    files = controller_files(request.name, _draft(request).kernels, kernels, precision, _versions())
    with _write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        _write_files(folder, files)
    return folder


def _versions() -> dict[str, str]:
    return {"symgen": VERSION, "casadi": version("casadi")}


@dataclass(frozen=True, slots=True)
class _Draft:
    """A robot whose model and configuration were read and checked."""

    chain: Chain
    kernels: Kernels
    facts: dict[str, Any]
    notes: tuple[str, ...]


def _draft(request: BuildRequest) -> _Draft:
    chain = within_loops(read_chain(request.urdf, request.options))
    pi0, projected = initial_parameters(chain, request.project)
    catalogue = make_catalogue(chain, request.config.collision)
    facts = model_facts(chain, request, catalogue.base, pi0, projected, catalogue.omitted)
    return _Draft(chain, catalogue.kernels, facts, notes_of(chain, projected))


def _texts(request: BuildRequest, draft: _Draft) -> dict[str, str]:
    longest = LONG if draft.chain.is_large else None
    files = emit(request.name, draft.kernels, draft.facts, _versions(), longest)
    files[f"{request.name}.urdf"] = draft.chain.urdf
    # Commands that compile the folder on a machine without symgen, and hashes of its files.
    digests = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()}
    how = how_to_compile(*([name for name in kind if name in files] for kind in _KINDS))
    return files | {"compile.json": json_text({"files": digests, **how})}


def is_current(request: BuildRequest, folder: Path, levels: Sequence[str] | None = None) -> bool:
    """Check that a folder was built by this user from exactly this request, and is intact."""
    try:
        record, library = json_of(folder / "build.json"), folder / f"lib{request.name}.so"
        return bool(
            record["fingerprint"] == request.fingerprint
            and (levels is None or record["levels"] == sorted(set(levels)))
            and record["sha256"] == sha256_of(library)
            and is_user_build(library, record["sha256"])
            and all(
                sha256_of(folder / name) == digest for name, digest in record["sources"].items()
            )
        )
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _fill(staging: Path, request: BuildRequest, draft: _Draft, levels: Sequence[str]) -> str:
    """Write and compile all files."""
    files = _texts(request, draft)
    _write_files(staging, files)
    library = staging / f"lib{request.name}.so"
    compiled = compile_library(staging, json_of(staging / "compile.json"), levels, library)
    record = {
        "fingerprint": request.fingerprint,
        "levels": sorted(set(levels)),
        "sha256": compiled.sha256,
        "sources": {name: sha256_of(staging / name) for name in files},
        "commands": [shlex.join(command) for command in compiled.commands],
        "compiler": compiled.version,
    }
    (staging / "build.json").write_text(json_text(record))
    library.chmod(0o755)  # the run time opens what only its user writes
    return compiled.sha256


def _write_files(staging: Path, files: Mapping[str, str]) -> None:
    for name, text in files.items():
        (staging / name).write_text(text, encoding="utf-8", newline="\n")


@contextmanager
def _write_errors(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise BuildError(
            f"cannot write '{folder}': {error.strerror or error}; check space and permissions, "
            "then build again (the previous library, if any, is unchanged)"
        ) from error


def replace_folder(new: Path, old: Path) -> None:
    """Put a folder in the place of another, whose further files stay; atomic on Linux."""
    if not old.exists():
        new.rename(old)
        return
    for path in old.iterdir():
        if not (new / path.name).exists() and not path.name.endswith(_OF_ONE_BUILD):
            (shutil.copytree if path.is_dir() else shutil.copy2)(path, new / path.name)
    if not _exchange(new, old):
        aside = new.with_name(new.name + ".old")
        old.rename(aside)
        try:
            new.rename(old)
        except OSError:
            aside.rename(old)
            raise
        new = aside
    shutil.rmtree(new, ignore_errors=True)


def require_no_foreign_file(new: Path, old: Path) -> None:
    """Refuse to replace a file of a folder that no build has written."""
    if (old / "manifest.json").exists() or (old / "build.json").exists():
        return  # of an earlier build
    for path in sorted(new.iterdir()):
        mine = old / path.name
        if os.path.lexists(mine) and not (mine.is_file() and filecmp.cmp(mine, path, False)):
            raise BuildError(
                f"'{mine}' exists, and no build has written this folder; choose another --out or "
                "--name, or give --overwrite"
            )


def _exchange(a: Path, b: Path) -> bool:
    """Exchange two names atomically; False where the system does not support it."""
    rename = getattr(ctypes.CDLL(None), "renameat2", None)
    if rename is None:
        return False
    paths = (os.fsencode(a), os.fsencode(b))
    return bool(rename(_AT_FDCWD, paths[0], _AT_FDCWD, paths[1], _RENAME_EXCHANGE) == 0)


def expected_cost(
    kernels: Iterable[Kernel], levels: Sequence[str], cores: int | None = None
) -> ExpectedCost:
    """Return the expected cost of the compilation of some kernels."""
    operations = sum(len(kernel.instructions) for kernel in kernels)
    wanted = tuple(name for name in level_names() if not levels or name in levels)
    is_fallback = bool({*wanted} - {*PORTABLE, REFERENCE})
    of_level = _PER_LEVEL | (dict.fromkeys(PORTABLE, _FALLBACK) if is_fallback else {})
    pairs = (_ONCE, *(of_level[name] for name in wanted))
    at_once = min(cores or os.cpu_count() or 1, 4)  # of the files four are large
    cpu_s = sum(fixed + rate * operations for fixed, rate in pairs)
    return ExpectedCost(operations, cpu_s, expected_memory(operations, at_once), wanted)


def expected_memory(operations: int, at_once: int) -> float:
    """Largest memory of this process and its compilers."""
    process, compiler = (fixed + rate * operations for fixed, rate in (_PYTHON_MB, _COMPILER_MB))
    return process + at_once * compiler
