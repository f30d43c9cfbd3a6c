"""The C compiler of this machine: which one, what it supports, and how it is called."""

import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from runtime.common.errors import CompilerError

Words = tuple[str, ...]


def find_compiler() -> Words:
    """Command of the C compiler: $CC, else cc, gcc or clang of the PATH, else the ziglang wheel."""
    chosen = tuple(shlex.split(os.environ.get("CC", "")))
    if chosen:
        if shutil.which(chosen[0]) is None:
            raise CompilerError(
                f"$CC names the compiler '{chosen[0]}', which is not on the PATH; "
                "install it or unset CC"
            )
        return chosen
    name = next(filter(shutil.which, ("cc", "gcc", "clang")), None)
    if name:
        return (name,)
    if importlib.util.find_spec("ziglang"):
        # -P: the compiler runs in a generated folder, whose ziglang.py is not the wheel. Zig tests
        # for undefined behaviour unless it optimises, and first compiles a library for that, 18 s.
        return (sys.executable, "-P", "-m", "ziglang", "cc", "-fno-sanitize=undefined")
    raise CompilerError(
        "no C compiler found for the code of a robot (looked for $CC, cc, gcc, clang and the "
        "ziglang wheel); install one, for example with: pip install ziglang, or "
        "pip install 'symgen[zig]'"
    )


def machine() -> str:
    """Architecture of this machine: x86_64, aarch64, or the name that the system gives."""
    name = platform.machine().lower()
    return {"amd64": "x86_64", "arm64": "aarch64"}.get(name, name)


def compiler_version(compiler: Words) -> str:
    """First line of the compiler's `--version`."""
    run = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False)
    return (run.stdout.strip().splitlines() or ["unknown"])[0]


def spelled(flag: str, compiler: Words) -> str:
    """The flag as this compiler writes it: zig spells instruction sets with underscores."""
    if not flag.startswith("-march=") or "ziglang" not in compiler:
        return flag
    return f"-march={flag.removeprefix('-march=').replace('-', '_')}"


def accepts(compiler: Words, flags: Sequence[str]) -> bool:
    """Whether the compiler supports all these flags, such as an instruction set."""
    path = shutil.which(compiler[0]) or compiler[0]
    date = os.stat(path).st_mtime if os.path.exists(path) else 0.0  # a new one has its own answers
    return not flags or _probed(compiler, tuple(flags), path, date)


@cache
def _probed(compiler: Words, flags: Words, *_: object) -> bool:
    probe = [*compiler, "-Werror", *flags, "-x", "c", "-E", os.devnull]
    return subprocess.run(probe, capture_output=True, check=False).returncode == 0


def compile_commands(
    how: Mapping[str, Any], levels: Sequence[str], compiler: Words, folder: Path, target: Path
) -> list[Words]:
    """Commands that compile the C files of a folder, the longest first, and link `target`."""
    place = "" if target.parent == folder else f"{target.parent}/"
    units: list[tuple[int, Words]] = []
    has_better = False  # levels are listed from the best on
    for group in how["groups"]:
        level = group["level"]
        flags = [spelled(flag, compiler) for flag in group["flags"]]
        sets = [flag for flag in flags if flag.startswith("-march=")]
        if (level and level not in levels) or not accepts(compiler, sets):
            continue
        flags += group["gcc"] if accepts(compiler, group["gcc"]) else ()  # only GCC accepts them
        flags += group["beside"] if has_better else ()
        has_better |= bool(level)
        for name in group["sources"]:
            made = f"{place}{Path(name).stem}{'_' * bool(level)}{level}.o"
            command = (*compiler, *how["flags"], *flags, "-c", name, "-o", made)
            units.append(((folder / name).stat().st_size, command))
    commands = [command for _, command in sorted(units, key=lambda unit: -unit[0])]
    objects = [command[-1] for command in commands]
    return [*commands, (*compiler, "-o", f"{place}{target.name}", *objects, *how["link"])]


def run(command: Words, folder: Path) -> None:
    """Run the compiler in a folder; its complaint or the lack of its output is an error."""
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, errors="replace", check=False
    )
    if done.returncode or not (folder / command[command.index("-o") + 1]).exists():
        complaint = "\n".join(done.stderr.strip().splitlines()[:20])
        if not complaint:
            state = (
                f"with exit status {done.returncode}" if done.returncode else "without its output"
            )
            complaint = f"it ended {state} and no message; check the compiler that $CC names"
        raise CompilerError(f"'{shlex.join(command)}' failed:\n{complaint}")
