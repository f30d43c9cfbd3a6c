"""A mutant put into a running process: the code of loaded functions, or the text of an import."""

import gc
import importlib.util
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

_OPTIMIZED = 0x1
"""Flag of the code of functions, which the bodies of modules and classes lack."""
Key = tuple[str, int]
"""Qualified name and first line of a function."""


def functions_by_file(folder: Path) -> dict[str, list[FunctionType]]:
    """Return every loaded function whose source lies below a folder.

    Args:
        folder: root of the sources.

    Returns:
        Functions by path of their file, relative to the folder.
    """
    found: dict[str, list[FunctionType]] = {}
    start = f"{folder}/"
    gc.unfreeze()  # frozen objects are not listed
    for thing in gc.get_objects():
        if type(thing) is FunctionType and thing.__code__.co_filename.startswith(start):
            found.setdefault(thing.__code__.co_filename.removeprefix(start), []).append(thing)
    return found


def exchanges(
    functions: Sequence[FunctionType], path: Path, text: str
) -> list[tuple[FunctionType, CodeType]]:
    """Return the loaded functions whose code an altered text changes, with their new code.

    Args:
        functions: of the file.
        path: of the file.
        text: altered text, with as many lines as the file has.

    Returns:
        Pairs; empty where the change takes effect at import only.
    """
    codes: dict[Key, CodeType | None] = {}
    _collect(compile(text, str(path), "exec", dont_inherit=True), codes)
    changed = []
    for function in functions:
        old = function.__code__
        new = codes.get((old.co_qualname, old.co_firstlineno))
        if new is not None and not _same(old, new):
            changed.append((function, new))
    return changed


def import_altered(module: str, path: Path, text: str) -> None:
    """Make the next import of a module execute another text; subprocesses are not affected.

    Args:
        module: its name.
        path: of its file.
        text: executed instead of the file.
    """
    sys.meta_path.insert(0, _Finder(module, path, text))


class _Loader(SourceFileLoader):
    def __init__(self, name: str, path: Path, text: str) -> None:
        super().__init__(name, str(path))
        self.text = text

    def get_code(self, fullname: str) -> CodeType:
        return compile(self.text, self.path, "exec", dont_inherit=True)


class _Finder:
    def __init__(self, module: str, path: Path, text: str) -> None:
        self.module, self.path, self.text = module, path, text

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name != self.module:
            return None
        loader = _Loader(name, self.path, self.text)
        return importlib.util.spec_from_file_location(name, self.path, loader=loader)


def _collect(code: CodeType, codes: dict[Key, CodeType | None]) -> None:
    for part in code.co_consts:
        if isinstance(part, CodeType):
            if part.co_flags & _OPTIMIZED:
                key = (part.co_qualname, part.co_firstlineno)
                codes[key] = None if key in codes else part  # two lambdas of one line
            _collect(part, codes)


def _same(a: CodeType, b: CodeType) -> bool:
    """Whether two codes do the same; equality of code also compares columns."""
    if (a.co_code, a.co_names, a.co_varnames) != (b.co_code, b.co_names, b.co_varnames):
        return False
    pairs = list(zip(a.co_consts, b.co_consts, strict=False))
    return len(a.co_consts) == len(b.co_consts) and all(
        _same(x, y) if isinstance(x, CodeType) and isinstance(y, CodeType) else repr(x) == repr(y)
        for x, y in pairs
    )
