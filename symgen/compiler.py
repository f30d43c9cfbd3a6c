"""C sources → shared library: finds a compiler, shows its complaint, records the exact command."""

import hashlib
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from symgen.errors import CompilerError

FLAGS = (
    "-std=c99",
    "-O2",
    "-fPIC",
    "-shared",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-Wall",
    "-Wextra",
    "-Wno-unused-parameter",  # a kernel may not need every input: M(q) of a 1-joint arm
)
"""Never -ffast-math: it breaks range reduction and the handling of NaN."""


@dataclass(frozen=True, slots=True)
class Compiled:
    """What was run and what came out."""

    command: tuple[str, ...]
    version: str
    sha256: str


def find_compiler() -> tuple[str, ...]:
    """$CC, else cc, gcc or clang of the PATH, else the ziglang wheel.

    Raises:
        CompilerError: none of them is there.
    """
    asked = shlex.split(os.environ.get("CC", ""))
    if asked:
        if shutil.which(asked[0]) is None:
            raise CompilerError(
                f"$CC asks for the compiler '{asked[0]}', which is not on the PATH; "
                "install it or unset CC"
            )
        return tuple(asked)
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return (name,)
    if importlib.util.find_spec("ziglang"):
        return (sys.executable, "-m", "ziglang", "cc")
    raise CompilerError(
        "no C compiler found (looked for $CC, cc, gcc, clang and the ziglang wheel); "
        "install one, for example with: pip install ziglang"
    )


def compile_library(sources: list[Path], target: Path) -> Compiled:
    """Compile sources into the shared library `target`.

    Raises:
        CompilerError: the compiler failed; its message is part of the sentence.
    """
    compiler = find_compiler()
    names = [str(source.name) for source in sources]
    command = (*compiler, *FLAGS, "-o", target.name, *names, "-lm")
    run = subprocess.run(command, cwd=target.parent, capture_output=True, text=True, check=False)
    if run.returncode != 0 or not target.exists():
        complaint = "\n".join(run.stderr.strip().splitlines()[:20])
        raise CompilerError(f"'{shlex.join(command)}' failed:\n{complaint}")

    return Compiled(command, compiler_version(compiler), sha256_of(target))


def compiler_version(compiler: tuple[str, ...]) -> str:
    """First line of `--version`."""
    run = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False)
    return run.stdout.strip().splitlines()[0] if run.stdout.strip() else "unknown"


def sha256_of(path: Path) -> str:
    """Hash of a file's bytes."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
