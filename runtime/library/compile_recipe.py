"""`compile.json`: how the C of a generated folder becomes a library; data, and checked as such.

It names files of its folder and flags of a fixed set, so that a damaged or a foreign one can make
the compiler do nothing but compile.
"""

import hashlib
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.common.files import bytes_of, json_of, require_file
from runtime.errors import LibraryError

REFERENCE = "casadi"
"""Level that the others are compared with; compiled only on request."""

_FLAG = re.compile(
    r"-std=c99|-fPIC|-fno-math-errno|-fno-trapping-math|-O[0-3]|-shared|-lm"
    r"|-ffp-contract=fast|-fno-tree-(slp-)?vectorize"
    r"|-fno-(tree-(dse|vrp|pre|pta|fre|ccp|copy-prop|dominator-opts)|ipa-(icf|modref|sra)|dse|ree)"
    r"|-fno-(cprop-registers|rerun-cse-after-loop|code-hoisting|forward-propagate)"
    r"|-fno-ira-share-spill-slots|-fira-region=one|--param=lra-max-considered-reload-pseudos=20"
    r"|-DQUICK|-DBY_SAMPLE|-D(LEVEL|W)=[a-z0-9]{1,16}|-march=x86-64-v[234]"
)
_FILE = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,80}\.(c|h|json|md|urdf)")
_WORD = re.compile(r"[a-z0-9_]{0,16}")


@dataclass(frozen=True, slots=True)
class Group:
    """Files that are compiled alike, the level they make and the machine they are for ("": all).

    `gcc` are flags for a compiler that supports all of them; they shorten compilation. `beside` are
    flags of a level that is compiled beside a better one, which is loaded in its place.
    """

    level: str
    machine: str
    sources: tuple[str, ...]
    flags: tuple[str, ...]
    gcc: tuple[str, ...]
    beside: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CompileRecipe:
    """Content of `compile.json`; `digest` is that of its bytes, `files` are name → sha256."""

    digest: str
    files: dict[str, str]
    flags: tuple[str, ...]
    groups: tuple[Group, ...]
    link: tuple[str, ...]

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
        raw = json_of(data)
        recipe = CompileRecipe(
            digest=hashlib.sha256(data).hexdigest(),
            files={_matched(_FILE, name): str(digest) for name, digest in raw["files"].items()},
            flags=_all(_FLAG, raw["flags"]),
            groups=tuple(
                Group(
                    level=_matched(_WORD, group["level"]),
                    machine=_matched(_WORD, group["machine"]),
                    sources=_all(_FILE, group["sources"]),
                    flags=_all(_FLAG, group["flags"]),
                    gcc=_all(_FLAG, group["gcc"]),
                    beside=_all(_FLAG, group.get("beside", [])),
                )
                for group in _list(raw["groups"])
            ),
            link=_all(_FLAG, raw["link"]),
        )
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise LibraryError(
            f"'{path}' is damaged ({type(error).__name__}: {error}); {again}"
        ) from None
    for name in sorted({name for group in recipe.groups for name in group.sources}):
        if not name.endswith(".c") or name not in recipe.files:
            raise LibraryError(
                f"'{path}' is damaged (it compiles '{name}' but does not list it); {again}"
            )
    return recipe


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


def _matched(pattern: re.Pattern[str], text: Any) -> str:
    if not isinstance(text, str) or not pattern.fullmatch(text):
        raise ValueError(f"{text!r:.80} has no place in it")
    return text


def _all(pattern: re.Pattern[str], texts: Any) -> tuple[str, ...]:
    return tuple(_matched(pattern, text) for text in _list(texts))


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise TypeError(f"a list is expected, got {value!r:.80}")
    return value
