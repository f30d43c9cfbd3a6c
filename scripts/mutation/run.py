"""Run tests on the mutants of a room, each in a forked process on a copy of the repository.

A mutant meets the tests of its room, then the test files elsewhere that import its module.
"""

import ast
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from shutil import copy2, which

from scripts.mutation.mutants import Mutant, mutants_of
from scripts.mutation.rooms import ROOMS, Room

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENTS = Path(__file__).with_name("equivalents.toml")
HEAVY = ("numpy", "scipy.optimize", "scipy.signal", "scipy.linalg", "clarabel", "casadi", "pytest")
"""Libraries that every test imports, imported once before the forks."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Mutants of one room by what the tests said.

    Attributes:
        room: its name.
        noticed: number of mutants on which a test failed or took too long.
        equivalent: mutants that `equivalents.toml` lists with a reason.
        survived: mutants on which every test passed.
    """

    room: str
    noticed: int
    equivalent: tuple[Mutant, ...]
    survived: tuple[Mutant, ...]

    @property
    def share(self) -> float:
        """Share of the mutants noticed, without the equivalent ones; 1 where there are none."""
        counted = self.noticed + len(self.survived)
        return self.noticed / counted if counted else 1.0


def mutate(
    name: str,
    count: int,
    seed: int,
    limit_s: float | None = None,
    say: Callable[[str], None] = print,
) -> Outcome:
    """Run a seeded sample of the mutants of a room.

    Args:
        name: key of `ROOMS`.
        count: number of mutants.
        seed: of the sample.
        limit_s: time per mutant; None is five times that of the unaltered room and 20 s.
        say: receives a line per mutant that survives.

    Returns:
        The counts.

    Raises:
        RuntimeError: the tests of the room fail without any mutant.
    """
    room = ROOMS[name]
    every = [mutant for file in room.files(ROOT) for mutant in mutants_of(file, ROOT)]
    sample = random.Random(seed).sample(every, min(count, len(every)))  # noqa: S311
    known = {(e["path"], e["before"], e["after"]) for e in _equivalents()}
    for library in HEAVY:
        __import__(library)
    noticed, equivalent, survived = 0, list[Mutant](), list[Mutant]()
    with _copy() as folder:
        start = time.perf_counter()
        if not _passes(folder, room.tests, 1e4):
            raise RuntimeError(
                f"the tests of the room '{name}' fail before any mutation; expected them to pass; "
                f"run pytest {' '.join(room.tests)}"
            )
        limit = limit_s or 20 + 5 * (time.perf_counter() - start)
        imports = {path: _imported(ROOT / path) for path in _test_files(room)}
        for mutant in sample:
            if (mutant.path, mutant.before, mutant.after) in known:
                equivalent.append(mutant)
                continue
            path = folder / mutant.path
            whole = path.read_text(encoding="utf-8")
            path.write_text(mutant.text, encoding="utf-8")
            module = mutant.path.removesuffix(".py").replace("/", ".")
            others = [path for path, names in imports.items() if module in names]
            passed = _passes(folder, room.tests, limit) and (
                not others or _passes(folder, others, limit)
            )
            path.write_text(whole, encoding="utf-8")
            if not passed:
                noticed += 1
                continue
            survived.append(mutant)
            say(f"{mutant.path}:{mutant.line}\n  - {mutant.before}\n  + {mutant.after}")
    return Outcome(name, noticed, tuple(equivalent), tuple(survived))


def _equivalents() -> list[dict[str, str]]:
    entries = tomllib.loads(EQUIVALENTS.read_text(encoding="utf-8"))
    return list(entries.get("equivalent", []))


@contextmanager
def _copy() -> Iterator[Path]:
    """Temporary copy of the files that git tracks and of the built libraries."""
    listed = subprocess.run(
        [which("git") or "git", "ls-files", "-z"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    built = [p.relative_to(ROOT).as_posix() for p in (ROOT / "generated").rglob("*") if p.is_file()]
    with tempfile.TemporaryDirectory(prefix="mutate-") as folder:
        for name in {*filter(None, listed.split("\0")), *built}:
            target = Path(folder, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            if (ROOT / name).is_file():
                copy2(ROOT / name, target)
        yield Path(folder)


def _test_files(room: Room) -> list[str]:
    """Test files outside the folders and files of the room, sorted."""
    files = (path.relative_to(ROOT).as_posix() for path in (ROOT / "tests").rglob("test_*.py"))
    return sorted(f for f in files if not any(Path(f).is_relative_to(t) for t in room.tests))


def _imported(file: Path) -> set[str]:
    """Modules and names that a test file imports, a.b and a.b.c of `from a.b import c`."""
    names = set[str]()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def _passes(folder: Path, tests: Sequence[str], limit_s: float) -> bool:
    """Whether every test passes in time, in a process of its own."""
    child = os.fork()
    if child == 0:
        os.setsid()
        _tests(folder, tests)
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status) == 0
        time.sleep(0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def _tests(folder: Path, tests: Sequence[str]) -> None:
    """Run pytest in this process and end it with the exit code."""
    os.chdir(folder)
    os.environ.setdefault("SYMGEN_DATA", str(ROOT.parent / "shared"))
    os.environ["PYTHONPATH"] = str(folder)
    for name in [name for name in sys.modules if name.split(".")[0] in {"scripts", "tests"}]:
        del sys.modules[name]
    sys.path.insert(0, str(folder))
    sys.dont_write_bytecode = True
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    import pytest

    words = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]
    try:
        code = int(pytest.main(words))
    except BaseException:  # a mutant may raise anything, in a plugin or at import
        code = 1
    os._exit(code)
