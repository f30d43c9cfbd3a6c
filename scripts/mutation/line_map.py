"""Map from lines to the tests that execute them, recorded once by `scripts/mutate --map`.

A line is looked up in the text it had when the map was recorded, so that the map remains of use
after later changes. A constant of a module or a class is executed at import: its tests are those
which execute a line that mentions its name.
"""

import ast
import difflib
import json
import os
import re
import subprocess
import sys
from functools import cached_property
from pathlib import Path

from coverage import CoverageData

from scripts.mutation.mutants import Mutant
from scripts.mutation.recorder import FOLDER, PACKAGES


def record(root: Path, folder: Path) -> int:
    """Run every test once under coverage and write the map.

    Args:
        root: of the repository.
        folder: of the map; its files are replaced.

    Returns:
        Exit code of pytest.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for file in [*folder.glob("lines.*"), *folder.glob("times.*")]:
        file.unlink()
    texts = {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
        for package in PACKAGES
        for path in sorted((root / package).rglob("*.py"))
    }
    (folder / "sources.json").write_text(json.dumps(texts), encoding="utf-8")
    words = ["-m", "pytest", "-q", "-n", "2", "-p", "scripts.mutation.recorder"]
    environment = os.environ | {FOLDER: str(folder)}
    return subprocess.run(
        [sys.executable, *words], cwd=root, env=environment, check=False
    ).returncode


class LineMap:
    """Tests by line.

    Attributes:
        seconds: CPU time of each test at the recording.
    """

    def __init__(self, root: Path, folder: Path) -> None:
        if not (folder / "sources.json").is_file():
            raise RuntimeError(
                f"expected a map of lines and tests in '{folder}', found none; "
                "run scripts/mutate --map"
            )
        self.root = root
        self._recorded: dict[str, str] = json.loads((folder / "sources.json").read_text("utf-8"))
        self.seconds: dict[str, float] = {}
        for file in sorted(folder.glob("times.*")):
            for row in file.read_text("utf-8").splitlines():
                name, seconds, *_ = json.loads(row)
                self.seconds[name] = seconds
        self._data = [CoverageData(str(file)) for file in sorted(folder.glob("lines.*"))]
        for data in self._data:
            data.read()
        self._tests: dict[str, dict[int, set[str]]] = {}
        self._lines: dict[str, dict[int, int]] = {}

    def tests_of(self, mutant: Mutant) -> set[str]:
        """Return the tests that execute the line of a mutant, or that use what it defines."""
        text = (self.root / mutant.path).read_text(encoding="utf-8")
        if not mutant.path.endswith(".py"):
            return set()
        tree = ast.parse(text)
        first, last = _statement(tree, mutant.line)
        found = self.at(mutant.path, range(first, last + 1))
        if not found:
            for name in _defined(tree, mutant.line):
                found |= self._mentioning(name, mutant)
        return found or self.at(mutant.path, range(1, len(text.splitlines()) + 1))

    def at(self, path: str, lines: range) -> set[str]:
        """Return the tests that execute one of these lines of the present file."""
        tests, old = self._of_file(path), self._old_lines(path)
        return set[str]().union(*(tests.get(old.get(line, 0), set()) for line in lines)) - {""}

    def _mentioning(self, name: str, mutant: Mutant) -> set[str]:
        pattern = re.compile(rf"\b{re.escape(name)}\b")
        found = set[str]()
        for path, text in self._texts.items():
            for number, line in enumerate(text.splitlines(), 1):
                if pattern.search(line) and (path, number) != (mutant.path, mutant.line):
                    found |= self.at(path, range(number, number + 1))
        return found

    @cached_property
    def _texts(self) -> dict[str, str]:
        files = [f for package in PACKAGES for f in sorted((self.root / package).rglob("*.py"))]
        return {f.relative_to(self.root).as_posix(): f.read_text("utf-8") for f in files}

    def _of_file(self, path: str) -> dict[int, set[str]]:
        if path not in self._tests:
            tests: dict[int, set[str]] = {}
            for data in self._data:
                for name in data.measured_files():
                    if name.endswith(f"/{path}"):
                        for line, contexts in data.contexts_by_lineno(name).items():
                            tests.setdefault(line, set()).update(contexts)
            self._tests[path] = tests
        return self._tests[path]

    def _old_lines(self, path: str) -> dict[int, int]:
        """Number of each line at the recording; a new line counts as the one before it."""
        if path not in self._lines:
            old = self._recorded.get(path, "").splitlines()
            new = (self.root / path).read_text(encoding="utf-8").splitlines()
            numbers: dict[int, int] = {}
            match = difflib.SequenceMatcher(None, old, new, autojunk=False)
            for _, a, a_end, b, b_end in match.get_opcodes():
                for k in range(b, b_end):
                    numbers[k + 1] = min(a + k - b, max(a_end - 1, 0)) + 1
            self._lines[path] = numbers
        return self._lines[path]


def _statement(tree: ast.Module, line: int) -> tuple[int, int]:
    """First and last line of the smallest statement, or head of a block, around a line."""
    best = (line, line + 10**6)
    for node in ast.walk(tree):
        if not isinstance(node, ast.stmt):
            continue
        last = node.end_lineno or node.lineno
        if body := getattr(node, "body", None):
            last = max(node.lineno, body[0].lineno - 1)
        if node.lineno <= line <= last and last - node.lineno < best[1] - best[0]:
            best = (node.lineno, last)
    return best if best[1] < line + 10**6 else (line, line)


def _defined(tree: ast.Module, line: int) -> list[str]:
    """Names that a line defines: constant, field and its class, function, argument of a call."""
    names = list[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword) and node.arg and node.lineno == line:
            names.append(node.arg)
        if not (hasattr(node, "lineno") and node.lineno <= line <= (node.end_lineno or 0)):
            continue
        match node:
            case ast.Assign(targets=targets):
                names += [t.id for t in targets if isinstance(t, ast.Name)]
            case ast.AnnAssign(target=ast.Name(id=name)) | ast.AugAssign(target=ast.Name(id=name)):
                names.append(name)
            case ast.ClassDef(name=name) | ast.FunctionDef(name=name):
                names.append(name)
    return names
