"""C and C++ helpers of the benchmarks, compiled on first use and cached.

A library lies under ~/.cache/symgen/bench/<hash of source, flags, compiler and versions>.so, so
that Pinocchio's templates, a minute of compilation, are paid for once.
"""

import ctypes
import hashlib
import os
import shlex
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from bench.front import BenchError

CACHE = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "symgen" / "bench"


@dataclass(frozen=True, slots=True)
class Compiler:
    """A command and the first line of its `--version`."""

    command: str
    version: str


def find(names: tuple[str, ...]) -> Compiler:
    """The first compiler of the PATH."""
    for name in names:
        if shutil.which(name):
            version = subprocess.run(
                [name, "--version"], capture_output=True, text=True, check=True
            )
            return Compiler(name, version.stdout.splitlines()[0])
    raise BenchError(f"none of the compilers {', '.join(names)} is on the PATH")


def compile_shared(
    compiler: Compiler, flags: tuple[str, ...], source: str, suffix: str, versions: str = ""
) -> tuple[Path, str]:
    """Path of the cached library of `source`, and the command that makes it."""
    key = "\n".join((source, *flags, compiler.version, versions, _processor()))
    target = CACHE / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}.so"
    command = (compiler.command, *flags, "-shared", "-fPIC", "-fvisibility=hidden")
    shown = shlex.join((*command, f"source{suffix}", "-o", target.name))
    if not target.exists():
        CACHE.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=CACHE) as folder:
            path, library = Path(folder) / f"source{suffix}", Path(folder) / "out.so"
            path.write_text(source, encoding="utf-8")
            run = subprocess.run(
                [*command, str(path), "-o", str(library)],
                capture_output=True,
                text=True,
                check=False,
            )
            if run.returncode != 0:
                errors = [line for line in run.stderr.splitlines() if "error" in line]
                complaint = (errors or run.stderr.splitlines() or ["no message"])[0]
                raise BenchError(f"{compiler.command} refused: {complaint[:300]}")
            library.replace(target)  # appears whole or not at all
    return target, shown


def open_shared(path: Path) -> ctypes.CDLL:
    """The library; a broken one is deleted from the cache."""
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        path.unlink(missing_ok=True)
        raise BenchError(f"the compiled helper cannot be loaded ({error}); run again") from None


def _processor() -> str:
    """Processor features on which -march=native depends."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return ""
    return "".join(dict.fromkeys(s for s in lines if s.startswith(("model name", "flags"))))
