"""The stages of a build: request → chain → catalogue → files → library → generated/<robot>/.

The folder is replaced as a whole by one atomic exchange, so that concurrent builds, a killed build
and a full disk leave either the old library or the new one.
"""

import fcntl
import hashlib
import json
import os
import shlex
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from symgen import __version__
from symgen.build.compile_recipe import how_to_compile
from symgen.build.compiler import Compilation, Compiled, find_compiler, sha256_of
from symgen.build.exchange import replace_folder, require_no_foreign_file
from symgen.build.expected_cost import ExpectedCost, expected_cost
from symgen.build.facts import initial_parameters, model_facts
from symgen.build.notes import notes_of
from symgen.build.objects import Objects
from symgen.build.request import BuildRequest
from symgen.build.user_builds import is_recorded, record_build
from symgen.catalogue import make_catalogue
from symgen.catalogue.omitted import LONG
from symgen.chain import Chain, read_chain
from symgen.documents import json_of
from symgen.emit import Early, EmittedRobot, emit, ignored
from symgen.errors import BuildError
from symgen.kernel import Kernel
from symgen.mechanics.loop_range import within_loops

ONCE = ("kernels.c", "update.c", "online.c", "closed_loop.c")
"""Sources compiled once."""
PER_LEVEL = ("tiles.c", "statistics.c", "descent.c", "convex.c", "excitation.c")
"""Sources compiled once per instruction set."""
UNHURRIED = ("reference.c",)
"""Sources compiled without optimisation, to save build time: their speed does not matter."""
_KINDS = (ONCE, PER_LEVEL, UNHURRIED)


@dataclass(frozen=True, slots=True)
class BuildResult:
    """Outcome of a build.

    Attributes:
        folder: generated folder.
        rebuilt: False if it was up to date.
        notes: sentences for the user.
    """

    folder: Path
    rebuilt: bool
    notes: tuple[str, ...]


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
        with _lock(root, request.name):
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


def generate(request: BuildRequest) -> tuple[EmittedRobot, tuple[str, ...]]:
    """Return all committed files of a robot as text, and notes for the user."""
    draft = _draft(request)
    return _emitted(request, draft), draft.notes


@dataclass(frozen=True, slots=True)
class _Draft:
    """A robot whose model and configuration were read and checked."""

    chain: Chain
    kernels: tuple[Kernel, ...]
    facts: dict[str, Any]
    notes: tuple[str, ...]


def _draft(request: BuildRequest) -> _Draft:
    chain = within_loops(read_chain(request.urdf, request.options))
    pi0, projected = initial_parameters(chain, request.project)
    catalogue = make_catalogue(chain, request.config.collision)
    facts = model_facts(chain, request, catalogue.base, pi0, projected, catalogue.omitted)
    return _Draft(chain, catalogue.kernels, facts, notes_of(chain, projected))


def _emitted(request: BuildRequest, draft: _Draft, early: Early = ignored) -> EmittedRobot:
    versions = {"symgen": __version__, "casadi": version("casadi")}
    longest = LONG if draft.chain.is_large else None
    robot = emit(request.name, draft.kernels, draft.facts, versions, early, longest)
    files = robot.files | {f"{request.name}.urdf": draft.chain.urdf}
    files["compile.json"] = _compile_facts(files)
    return EmittedRobot(files, robot.model_hash)


def is_current(request: BuildRequest, folder: Path, levels: Sequence[str] | None = None) -> bool:
    """Check that a folder was built by this user from exactly this request, and is intact."""
    try:
        record = json_of(folder / "build.json")
        return bool(
            record["fingerprint"] == request.fingerprint
            and (levels is None or record["levels"] == sorted(set(levels)))
            and record["sha256"] == sha256_of(folder / f"lib{request.name}.so")
            and is_recorded(record["sha256"])
            and all(
                sha256_of(folder / name) == digest for name, digest in record["sources"].items()
            )
        )
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _compile_facts(files: dict[str, str]) -> str:
    """Commands that compile the folder on a machine without symgen, and hashes of its files."""
    digests = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()}
    how = how_to_compile(*([name for name in kind if name in files] for kind in _KINDS))
    return json.dumps({"files": digests, **how}, indent=1) + "\n"


def _fill(staging: Path, request: BuildRequest, draft: _Draft, levels: Sequence[str]) -> str:
    """Write and compile all files; the compilation of a file starts as soon as it is written."""
    objects = Objects(request.name, find_compiler())
    with Compilation(staging, how_to_compile(*_KINDS), levels, objects) as compilation:
        started = set[str]()  # not written again: the compiler may be reading them

        def early(name: str, text: str) -> None:
            _write_files(staging, {name: text})
            compilation.start(name)
            started.add(name)

        files = _emitted(request, draft, early).files
        _write_files(staging, {name: files[name] for name in files if name not in started})
        compiled = _compile(compilation, staging / f"lib{request.name}.so", files)
    objects.prune()
    record = {
        "fingerprint": request.fingerprint,
        "levels": sorted(set(levels)),
        "sha256": compiled.sha256,
        "sources": {name: sha256_of(staging / name) for name in files},
        "commands": [shlex.join(command) for command in compiled.commands],
        "compiler": compiled.version,
    }
    (staging / "build.json").write_text(json.dumps(record, indent=1) + "\n")
    (staging / f"lib{request.name}.so").chmod(0o755)  # the run time opens what only its user writes
    return compiled.sha256


def _write_files(staging: Path, files: Mapping[str, str]) -> None:
    for name, text in files.items():
        (staging / name).write_text(text, encoding="utf-8", newline="\n")


def _compile(compilation: Compilation, library: Path, files: Mapping[str, str]) -> Compiled:
    return compilation.finish([name for kind in _KINDS for name in kind if name in files], library)


@contextmanager
def _lock(root: Path, name: str) -> Iterator[None]:
    """One build per robot at a time; the operating system drops the lock of a killed build."""
    # A link in the place of the lock would be followed by open(), and its target emptied.
    mode = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW
    with os.fdopen(os.open(root / f".{name}.lock", mode, 0o644), "r+") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        for stale in root.glob(f".{name}.*/"):
            shutil.rmtree(stale, ignore_errors=True)  # left by a killed build
        yield


@contextmanager
def _write_errors(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise BuildError(
            f"cannot write '{folder}': {error.strerror or error}; check space and permissions, "
            "then build again (the previous library, if any, is unchanged)"
        ) from error
