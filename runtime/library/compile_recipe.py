"""`compile.json`: how the C of a generated folder becomes a library; data, and checked as such.

It names files of its folder and flags of a fixed set, so that a damaged or a foreign one can make
the compiler do nothing but compile.
"""

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from runtime.common.files import bytes_of, json_of, require_file
from runtime.common.records import Record, record_from_table
from runtime.errors import LibraryError

REFERENCE = "casadi"
"""Level that the others are compared with; compiled only on request."""

_FLAGS = (
    r"-std=c99|-fPIC|-fno-math-errno|-fno-trapping-math|-O[0-3]|-shared|-lm"
    r"|-ffp-contract=fast|-fno-tree-(slp-)?vectorize"
    r"|-fno-(tree-(dse|vrp|pre|pta|fre|ccp|copy-prop|dominator-opts)|ipa-(icf|modref|sra)|dse|ree)"
    r"|-fno-(cprop-registers|rerun-cse-after-loop|code-hoisting|forward-propagate)"
    r"|-fno-ira-share-spill-slots|-fira-region=one|--param=lra-max-considered-reload-pseudos=20"
    r"|-DQUICK|-DBY_SAMPLE|-D(LEVEL|W)=[a-z0-9]{1,16}|-march=x86-64-v[234]"
)

Flag = Annotated[str, Meta(pattern=rf"\A({_FLAGS})\Z", description="a flag of symgen")]
FileName = Annotated[
    str,
    Meta(
        pattern=r"\A[A-Za-z][A-Za-z0-9_]{0,80}\.(c|cuh|h|json|md|urdf)\Z",
        description="a generated file",
    ),
]
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
