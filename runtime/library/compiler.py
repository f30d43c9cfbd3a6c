"""A generated folder and its recipe → a shared library, wherever there is a C compiler."""

import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from runtime.errors import LibraryError
from runtime.library.compile_recipe import CompileRecipe
from runtime.parallel import cores

Words = tuple[str, ...]


def find_compiler() -> Words:
    """Command of a C compiler: $CC, else cc, gcc or clang of the PATH, else the ziglang wheel."""
    chosen = tuple(shlex.split(os.environ.get("CC", "")))
    if chosen:
        if shutil.which(chosen[0]) is None:
            raise LibraryError(
                f"$CC names the compiler '{chosen[0]}', which is not on the PATH; install it or "
                "unset CC"
            )
        return chosen
    name_of_compiler = next(filter(shutil.which, ("cc", "gcc", "clang")), None)
    if name_of_compiler:
        return (name_of_compiler,)
    if importlib.util.find_spec("ziglang"):
        # -P: the compiler runs in a generated folder, whose ziglang.py is not the wheel. Zig tests
        # for undefined behaviour unless it optimises, and first compiles a library for that, 18 s.
        return (sys.executable, "-P", "-m", "ziglang", "cc", "-fno-sanitize=undefined")
    raise LibraryError(
        "the robot's C code is compiled at its first use, and there is no C compiler (looked for "
        "$CC, cc, gcc, clang and the ziglang wheel); get one with: pip install 'symgen[zig]'"
    )


def machine() -> str:
    """Processor architecture: x86_64, aarch64, or the name that the operating system reports."""
    name = platform.machine().lower()
    return {"amd64": "x86_64", "arm64": "aarch64"}.get(name, name)


def version_of(compiler: Words) -> str:
    """First line of `--version`."""
    run = subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False)
    return (run.stdout.strip().splitlines() or ["unknown"])[0]


def compile_folder(
    folder: Path, recipe: CompileRecipe, levels: Words, compiler: Words, target: Path
) -> list[Words]:
    """Compile the C code of a generated folder for some levels, outside that folder."""
    units: list[tuple[int, Words, Path]] = []
    has_better = False  # levels are listed from the best on
    spared = {group.gcc for group in recipe.groups if _accepts(compiler, group.gcc)}
    for group in recipe.groups:
        flags = [_spelled(flag, compiler) for flag in group.flags]
        sets = [flag for flag in flags if flag.startswith("-march=")]
        if (group.level and group.level not in levels) or not _accepts(compiler, sets):
            continue
        flags += group.gcc if group.gcc in spared else ()
        flags += group.beside if has_better else ()
        has_better |= bool(group.level)
        for name in group.sources:
            made = target.parent / f"{Path(name).stem}_{group.level}.o"
            command = (*compiler, *recipe.flags, *flags, "-c", name, "-o", str(made))
            units.append(((folder / name).stat().st_size, command, made))
    units.sort(key=lambda unit: -unit[0])  # the longest first
    commands = [command for _, command, _ in units]
    link = (*compiler, "-o", str(target), *(str(made) for *_, made in units), *recipe.link)
    from rich.console import Console
    from rich.progress import Progress, TimeElapsedColumn

    bar = Progress(
        *Progress.get_default_columns()[:2],
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
        disable=not sys.stderr.isatty(),
    )
    from concurrent.futures import ThreadPoolExecutor

    with bar, ThreadPoolExecutor(cores()) as pool:
        done = pool.map(lambda command: _run(command, folder), commands)
        list(bar.track(done, total=len(commands), description="compiling"))
    _run(link, folder)
    return [*commands, link]


def _spelled(flag: str, compiler: Words) -> str:
    """The flag as the compiler spells it: Zig has underscores in names of instruction sets."""
    if not flag.startswith("-march=") or "ziglang" not in compiler:
        return flag
    return f"-march={flag.removeprefix('-march=').replace('-', '_')}"


def _accepts(compiler: Words, flags: Sequence[str]) -> bool:
    """Whether the compiler supports all these flags, such as an instruction set."""
    probe = [*compiler, "-Werror", *flags, "-x", "c", "-E", os.devnull]
    return not flags or subprocess.run(probe, capture_output=True, check=False).returncode == 0


def _run(command: Words, folder: Path) -> None:
    run = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, errors="replace", check=False
    )
    if run.returncode or not Path(command[command.index("-o") + 1]).exists():
        complaint = "\n".join(run.stderr.strip().splitlines()[:20])
        raise LibraryError(f"'{shlex.join(command)}' failed:\n{complaint}")
