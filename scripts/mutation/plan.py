"""Tests for one mutant: those that execute its line, then the others of its room.

Tests of the room that are newer than the map come first: they may be the answer to a survivor.
"""

import ast
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path

from scripts.mutation.line_map import LineMap
from scripts.mutation.mutants import Mutant

NEW_S = 0.05
"""CPU time of a test that the map does not know [s]."""
STEPS_S = (0.05, 0.3, 2.0, 1e9)
"""Tests up to these times [s] come one group after the other, each group sorted by file."""


class Planner:
    """Chooses and orders tests.

    Args:
        root: of the repository.
        lines: map of lines and tests.
        known: every collected test.
        budget_s: CPU time of the tests of one mutant [s]; a quarter of it for tests that do not
            execute the line.

    Attributes:
        sound, broken: tests that passed, or failed, without any mutant.
        extra: CPU time of a test beyond that of the recording [s]: of a library that it builds.
    """

    def __init__(self, root: Path, lines: LineMap, known: Iterable[str], budget_s: float) -> None:
        self.root, self.lines, self.budget_s = root, lines, budget_s
        self.known = set(known)
        self.sound, self.broken = set[str](), set[str]()
        self.extra: dict[str, float] = {}
        self._killers: dict[str, Counter[str]] = {}
        self._imports: dict[str, set[str]] = {}

    def noticed(self, mutant: Mutant, test: str) -> None:
        """Remember the test that noticed a mutant; it comes first for others of the file."""
        self._killers.setdefault(mutant.path, Counter())[test] += 1

    def tests(self, mutant: Mutant, room_tests: Sequence[str]) -> list[str]:
        """Return the tests for a mutant, in order.

        Args:
            mutant: an altered line.
            room_tests: folders and files of the tests of its room.

        Returns:
            Names, within the budget of time.
        """
        usable = self.known - self.broken
        first = self.lines.tests_of(mutant) & usable
        module = mutant.path.removesuffix(".py").replace("/", ".")
        near = {t for t in usable - first if self._is_near(t, module, room_tests)}
        new = {t for t in near if t not in self.lines.seconds}
        common = self._killers.get(mutant.path, Counter()).most_common(3)
        favourites = [test for test, _ in common if test in first]
        ordered = self._within(first - set(favourites), self.budget_s)
        return [
            *favourites,
            *self._within(new, self.budget_s),
            *ordered,
            *self._within(near - new, self.budget_s / 4),
        ]

    def importing(self, mutant: Mutant, room_tests: Sequence[str]) -> list[str]:
        """Tests for a mutant that is applied before the tests are imported.

        Tests of symbolic code evaluate it where they are imported, which no map shows: the files
        that import the module come first, then tests that execute the line.

        Args:
            mutant: an altered line.
            room_tests: folders and files of the tests of its room.

        Returns:
            Names, within the budget of time.
        """
        usable = self.known - self.broken
        module = mutant.path.removesuffix(".py").replace("/", ".")
        new = {
            t
            for t in usable
            if t not in self.lines.seconds and self._is_near(t, module, room_tests)
        }
        direct = {t for t in usable if module in self._imported(t.split("::", maxsplit=1)[0])}
        covering = self.lines.tests_of(mutant) & usable
        return [
            *self._within(direct | new, self.budget_s),
            *self._within(covering - direct - new, self.budget_s / 2),
            *self._within(self._beside(covering & usable) - covering - direct, self.budget_s / 2),
        ]

    def of_room(self, room_tests: Sequence[str], robots: Sequence[str] = ()) -> list[str]:
        """Tests for a mutant of a template, whose text no map shows: those of the room.

        Args:
            room_tests: folders and files of the tests of its room.
            robots: parts of the names of the tests that count: robots that build fast.

        Returns:
            Names, within the budget of time.
        """
        near = {
            t
            for t in self.known - self.broken
            if self._is_near(t, "", room_tests) and (not robots or any(r in t for r in robots))
        }
        builds = sum(self.extra.get(t, 0.0) for t in near)  # the first one builds for all
        return self._within(near, self.budget_s + builds)

    def _beside(self, tests: set[str]) -> set[str]:
        """Tests of the files of some tests: a fixture that they share runs in the first one."""
        files = {t.split("::", maxsplit=1)[0] for t in self._within(tests, self.budget_s / 2)}
        return {t for t in self.known - self.broken if t.split("::", maxsplit=1)[0] in files}

    def _is_near(self, test: str, module: str, room_tests: Sequence[str]) -> bool:
        path = test.split("::", maxsplit=1)[0]
        return any(Path(path).is_relative_to(t) for t in room_tests) or (
            module in self._imported(path)
        )

    def _imported(self, path: str) -> set[str]:
        """Modules and names that a test file imports, a.b and a.b.c of `from a.b import c`."""
        if path not in self._imports:
            names = set[str]()
            for node in ast.walk(ast.parse((self.root / path).read_bytes())):
                if isinstance(node, ast.Import):
                    names |= {alias.name for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and node.module:
                    names |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
            self._imports[path] = names
        return self._imports[path]

    def _within(self, tests: set[str], budget_s: float) -> list[str]:
        """Fastest tests first until the budget is spent; files stay together in steps of time."""
        left, chosen = budget_s, list[str]()
        for test in sorted(tests, key=lambda t: (self._seconds(t), t)):
            left -= self._seconds(test)
            if left < 0 and chosen:
                break
            chosen.append(test)

        def step(test: str) -> int:
            return next(k for k, s in enumerate(STEPS_S) if self._seconds(test) <= s)

        chosen.sort(key=step)
        ordered = list[str]()
        for _, group in groupby(chosen, key=step):
            ordered += sorted(group, key=lambda t: t.split("::")[0])
        return ordered

    def _seconds(self, test: str) -> float:
        return self.lines.seconds.get(test, NEW_S) + self.extra.get(test, 0.0)
