"""Libraries that were compiled at first use, kept in the user's cache folder.

<cache>/<robot>-<hash of recipe, levels, machine>/<hash of the compiler>/lib<robot>.so, build.json

The recipe's bytes hold the hash of every source, so the name says what is inside. An entry comes
whole, by one rename; processes that want the same one wait for the first of them. Each use renews
the date of its build.json. Who compiles, prunes: of a robot stay the newest `KEPT` and whatever was
used within `UNUSED_S`. So nothing goes that a process is about to open; a library that is open
outlives its file.

The recipe is `compile.json` of a generated folder. It names files of this folder and flags of a
fixed set, so that a damaged or a foreign one can make the compiler do nothing but compile.
"""

import hashlib
import json
import os
import shlex
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any

import platformdirs
from filelock import FileLock
from msgspec import Meta, to_builtins
from rich.console import Console
from rich.progress import Progress, TimeElapsedColumn

from runtime.common.compiler import (
    Words,
    compile_commands,
    compiler_version,
    find_compiler,
    machine,
    run,
)
from runtime.common.files import bytes_of, json_of, json_text, require_file, sha256_of
from runtime.common.records import Record, record_from_table
from runtime.common.threads import cores
from runtime.common.user_builds import is_safe_from_others
from runtime.errors import CompilerError, LibraryError

REFERENCE = "casadi"  # level that the others are compared with; compiled only on request

_FLAGS = (
    r"-std=c99|-fPIC|-fno-math-errno|-fno-trapping-math|-O[0-3]|-shared|-lm"
    r"|-ffp-contract=fast|-fno-tree-(slp-)?vectorize"
    r"|-fno-(tree-(dse|vrp|pre|pta|fre|ccp|copy-prop|dominator-opts)|ipa-(icf|modref|sra)|dse|ree)"
    r"|-fno-(cprop-registers|rerun-cse-after-loop|code-hoisting|forward-propagate)"
    r"|-fno-ira-share-spill-slots|-fira-region=one|--param=lra-max-considered-reload-pseudos=20"
    r"|-DQUICK|-DBY_SAMPLE|-D(LEVEL|W)=[a-z0-9]{1,16}|-march=x86-64-v[234]"
)

Flag = Annotated[str, Meta(pattern=rf"\A({_FLAGS})\Z", description="a flag of symgen")]
_NAME = r"\A[A-Za-z][A-Za-z0-9_]{0,80}\.(c|cuh|h|json|md|urdf)\Z"
FileName = Annotated[str, Meta(pattern=_NAME, description="a generated file")]
Files = Annotated[
    dict[FileName, str], Meta(description="a table of generated files and their hashes")
]
Word = Annotated[str, Meta(pattern=r"\A[a-z0-9_]{0,16}\Z", description="a word of a-z, 0-9 and _")]


class Group(Record, frozen=True, kw_only=True, forbid_unknown_fields=False):
    """Files that are compiled alike, the level they make and the machine they are for ("": all).

    `gcc` are flags for a compiler that supports all of them; they shorten compilation. `beside` are
    flags of a level that is compiled beside a better one, which is loaded in its place.
    """

    level: Word
    machine: Word
    sources: tuple[FileName, ...]
    flags: tuple[Flag, ...]
    gcc: tuple[Flag, ...]
    beside: tuple[Flag, ...] = ()


class CompileRecipe(Record, frozen=True, forbid_unknown_fields=False):
    """Content of `compile.json`; `digest` is that of its bytes, `files` are name → sha256."""

    files: Files
    flags: tuple[Flag, ...]
    groups: tuple[Group, ...]
    link: tuple[Flag, ...]
    digest: str = ""

    def levels(self, machine: str) -> tuple[str, ...]:
        """The levels that can be compiled on a machine."""
        return tuple(g.level for g in self.groups if g.level and g.machine in {"", machine})


def read_recipe(folder: Path) -> CompileRecipe:
    """The recipe of a generated folder, whose files are those that symgen wrote."""
    path, again = folder / "compile.json", "install or generate the robot again"
    try:
        data = bytes_of(path)
    except (OSError, ValueError):
        raise LibraryError(
            f"'{folder}' holds neither a compiled library nor a compile.json that says how to "
            "make one; run: python -m symgen build"
        ) from None
    try:
        recipe = record_from_table(CompileRecipe, json_of(data), "compile.json", ValueError)
    except ValueError as error:
        raise LibraryError(f"'{path}' is damaged ({error}); {again}") from None
    for name in sorted({name for group in recipe.groups for name in group.sources}):
        if not name.endswith(".c") or name not in recipe.files:
            raise LibraryError(
                f"'{path}' is damaged (it compiles '{name}' but does not list it); {again}"
            )
    return recipe.replace(digest=hashlib.sha256(data).hexdigest())


def require_intact(folder: Path, recipe: CompileRecipe, names: Iterable[str] = ()) -> None:
    """Require that files of a generated folder are those that its recipe was written for."""
    for name in names or recipe.files:
        path = folder / name
        try:
            digest = hashlib.sha256(require_file(path).read_bytes()).hexdigest()
        except OSError as error:
            raise LibraryError(
                f"'{path}' cannot be read ({error.strerror}); install or generate the robot again"
            ) from None
        if digest != recipe.files.get(name):
            raise LibraryError(
                f"'{path}' is not the file that was generated, so nothing is compiled; "
                "install or generate the robot again"
            )


KEPT = 3  # number of libraries per robot that are kept regardless of their age
UNUSED_S = 30 * 86400.0  # time without use after which another library is deleted [s]
_ELSEWHERE = "set SYMGEN_CACHE to a folder that can be written"


def compiled_library(folder: Path, robot: str, level: str | None = None) -> Path:
    """Folder of the compiled library of a robot; all levels of this machine, or $SYMGEN_LEVELS."""
    recipe = read_recipe(folder)
    require_intact(folder, recipe, ["manifest.json"])
    levels = _wanted(recipe, level)
    words = json.dumps([recipe.digest, sorted(levels), machine(), sys.platform])
    key = f"{robot}-{hashlib.sha256(words.encode()).hexdigest()[:16]}"
    try:
        compiler = find_compiler()
        version = f"{shlex.join(compiler)} {compiler_version(compiler)}"
    except CompilerError:
        made = [entry for root in _roots() for entry in (root / key).glob("[0-9a-f]*/")]
        for entry in filter(lambda e: is_whole(e, robot), made):
            return _used(entry)  # by any compiler
        raise
    name = Path(key, hashlib.sha256(version.encode()).hexdigest()[:8])

    def compiled(library: Path, root: Path) -> dict[str, Any]:
        require_intact(folder, recipe)
        sys.stderr.write(
            f"symgen: compiling the C code of '{robot}' once for this machine with "
            f"{shlex.join(compiler)}, 10 to 60 s; the library is kept in {root}\n"
        )
        commands = compile_folder(folder, recipe, levels, compiler, library)
        facts = {"sources": recipe.files, "levels": sorted(levels), "compiler": version}
        return facts | {"commands": [shlex.join(command) for command in commands]}

    return _kept(name, robot, compiled)


def compiled_file(source: Path, flags: Words) -> Path:
    """Shared library of one C file, compiled once with these flags for this machine."""
    compiler = find_compiler()
    words = [source.read_text(encoding="utf-8"), flags, compiler, machine(), sys.platform]
    digest = hashlib.sha256(json.dumps(words).encode()).hexdigest()[:16]
    version = hashlib.sha256(compiler_version(compiler).encode()).hexdigest()[:8]

    def compiled(library: Path, _: Path) -> dict[str, Any]:
        command = (*compiler, "-O2", "-shared", "-fPIC", *flags, str(source.resolve()))
        run((*command, "-o", library.name), library.parent)
        return {"commands": [shlex.join(command)]}

    name = Path(f"{source.stem}-{digest}", version)
    return _kept(name, source.stem, compiled) / f"lib{source.stem}.so"


def _kept(name: Path, robot: str, compiled: Callable[[Path, Path], dict[str, Any]]) -> Path:
    """Folder of a library in the cache; `compiled` makes it and returns facts for build.json."""
    roots = _roots()
    for root in roots:
        if is_whole(root / name, robot):
            return _used(root / name)
    root = _writable(roots)
    with _lock((root / name).parent):
        if not is_whole(root / name, robot):
            with _new_folder(root / name) as made_in:
                library = made_in / f"lib{robot}.so"
                facts = compiled(library, root)
                library.chmod(0o755)  # whatever the mask: what others can write is not opened
                record = {"sha256": sha256_of(library), **facts}
                (made_in / "build.json").write_text(json_text(record))
    prune(root, robot)
    return root / name


def prune(root: Path, robot: str) -> list[Path]:
    """Delete the libraries of a robot that have not been used for `UNUSED_S`."""
    ages = {}
    for entry in root.glob(f"{robot}-{'[0-9a-f]' * 16}/{'[0-9a-f]' * 8}"):
        with suppress(OSError):  # another process prunes, too
            ages[entry] = time.time() - (entry / "build.json").stat().st_mtime
    old = [entry for entry in sorted(ages, key=lambda e: ages[e])[KEPT:] if ages[entry] > UNUSED_S]
    for entry in old:
        shutil.rmtree(entry, ignore_errors=True)
    if old:
        sys.stderr.write(
            f"symgen: deleted {len(old)} compiled libraries of '{robot}' from {root}, unused "
            f"for {UNUSED_S / 86400:.0f} days\n"
        )
    return old


def _used(entry: Path) -> Path:
    """The entry, with its time of use set to now; a folder that is read-only keeps its date."""
    with suppress(OSError):
        os.utime(entry / "build.json")
    return entry


def is_whole(entry: Path, robot: str) -> bool:
    """Whether the bytes of a library are those that this user has compiled."""
    try:
        library = entry / f"lib{robot}.so"
        is_safe = is_safe_from_others(entry) and is_safe_from_others(library)
        return is_safe and bool(json_of(entry / "build.json")["sha256"] == sha256_of(library))
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _wanted(recipe: CompileRecipe, level: str | None) -> tuple[str, ...]:
    known = recipe.levels(machine())
    requested = os.environ.get("SYMGEN_LEVELS", "").replace(",", " ").split()
    wanted = {*(requested or [name for name in known if name != REFERENCE])} | {level or ""} - {""}
    for name in sorted(wanted - {*known}):
        raise LibraryError(
            f"there is no level '{name}' on {machine()}, which has {', '.join(known)}; "
            "correct SYMGEN_LEVELS or the requested level"
        )
    return tuple(name for name in known if name in wanted)


def _roots() -> list[Path]:
    """Cache folders, the preferred one first."""
    requested = os.environ.get("SYMGEN_CACHE", "")
    if requested:
        root = Path(requested).expanduser().resolve()
        if root.exists() and not is_safe_from_others(root):
            raise LibraryError(
                f"expected SYMGEN_CACHE to be a folder that only you can write, got '{root}', "
                "which others own or can write; name another folder, or make it yours (chown, "
                "chmod go-w)"
            )
        return [root]
    private = Path(tempfile.gettempdir()) / f"symgen-{os.getuid()}"
    return [platformdirs.user_cache_path("symgen"), *([private] if _is_private(private) else [])]


def _is_private(folder: Path) -> bool:
    """Nobody else can have put a library there."""
    try:
        facts = folder.lstat()
    except OSError:
        return False
    return folder.is_dir() and facts.st_uid == os.getuid() and not facts.st_mode & 0o077


def _writable(roots: list[Path]) -> Path:
    """The first place that can be written; a private temporary one where none can."""
    first = roots[0]
    try:
        first.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=first).close()
    except OSError as error:
        reason = f"the cache folder '{first}' cannot be written ({error.strerror})"
        if os.environ.get("SYMGEN_CACHE"):
            raise LibraryError(f"{reason}; {_ELSEWHERE}") from None
        private = Path(tempfile.gettempdir()) / f"symgen-{os.getuid()}"
        with suppress(OSError):
            private.mkdir(mode=0o700)
        place = private if _is_private(private) else Path(tempfile.mkdtemp(prefix="symgen-"))
        sys.stderr.write(f"symgen: {reason}, so {place} serves; to keep it, {_ELSEWHERE}\n")
        return place
    return first


@contextmanager
def _lock(folder: Path) -> Iterator[None]:
    """One process per entry at a time; the kernel drops the lock of a killed one."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        with FileLock(folder / ".lock", mode=0o600):  # follows no link
            for stale in folder.glob(".new.*/"):
                shutil.rmtree(stale, ignore_errors=True)  # of a killed process
            yield
    except OSError as error:
        raise LibraryError(
            f"the cache folder '{folder}' cannot be written ({error.strerror}); free space, or "
            f"{_ELSEWHERE}"
        ) from None


@contextmanager
def _new_folder(place: Path) -> Iterator[Path]:
    """A folder that takes the place of another when the block ends without an error."""
    draft = Path(tempfile.mkdtemp(prefix=".new.", dir=place.parent))
    try:
        yield draft
        for rest in draft.glob("*.o"):
            rest.unlink()
        shutil.rmtree(place, ignore_errors=True)
        with suppress(OSError):  # another process was first, with the same bytes
            draft.rename(place)
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def compile_folder(
    folder: Path, recipe: CompileRecipe, levels: Words, compiler: Words, target: Path
) -> list[Words]:
    """Compile the C code of a generated folder for some levels, outside that folder."""
    *commands, link = compile_commands(to_builtins(recipe), levels, compiler, folder, target)
    columns = (*Progress.get_default_columns()[:2], TimeElapsedColumn())
    console, is_quiet = Console(stderr=True), not sys.stderr.isatty()
    bar = Progress(*columns, console=console, transient=True, disable=is_quiet)
    with bar, ThreadPoolExecutor(cores()) as pool:
        done = pool.map(lambda command: run(command, folder), commands)
        list(bar.track(done, total=len(commands), description="compiling"))
    run(link, folder)
    return [*commands, link]
