"""Tests collected once; each mutant meets them in a forked copy of the process.

The code of the loaded functions is exchanged in the copy. A change that takes effect only at
import, and one of symgen, whose tests evaluate symbols where they are imported, meets its tests
in a process that has imported nothing of the product.
"""

import gc
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import pytest

from scripts.mutation.alteration import exchanges, functions_by_file, import_altered
from scripts.mutation.children import Ended, Watch, ended
from scripts.mutation.mutants import Mutant
from scripts.mutation.plan import Planner

QUIET = ("-q", "-s", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:faulthandler")
HEAVY = ("numpy", "scipy.optimize", "scipy.signal", "scipy.linalg", "clarabel", "casadi")
"""Libraries that nearly every test imports, imported once before the forks."""
WARM = ("lib", "ideal_runs", "noisy", "log", "panda", "clean")
"""Fixtures of a session that most tests of run time need: a robot, simulated and real logs."""
BUILD_S = 4.0
"""CPU time of a build, which a mutant of symgen cannot share with others [s]."""


@dataclass(frozen=True, slots=True)
class Job:
    """A mutant, tests of its room, tests that it meets, and robots that their names contain."""

    mutant: Mutant
    room_tests: tuple[str, ...]
    tests: tuple[str, ...] = ()
    robots: tuple[str, ...] = ()


Report = Callable[[Job, Ended], None]


class Server:
    """Pytest plugin: instead of running the tests once it runs some of them per mutant.

    Args:
        root: where the tests are collected.
        jobs: mutants.
        planner_of: makes the planner from the names of the collected tests.
        processes: children at a time.
        report: called with each outcome.
    """

    def __init__(
        self,
        root: Path,
        jobs: Sequence[Job],
        planner_of: Callable[[Sequence[str]], Planner],
        processes: int,
        report: Report,
    ) -> None:
        self.root, self.jobs, self.processes, self.report = root, jobs, processes, report
        self.planner_of = planner_of
        self.cold: list[Job] = []
        self.served = False

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Serve every mutant."""
        items = {item.nodeid: item for item in session.items}
        planner = self.planner = self.planner_of(list(items))
        functions = functions_by_file(self.root)
        if any(job.mutant.path.startswith("symgen/") for job in self.jobs):
            planner.extra = {name: BUILD_S for name, item in items.items() if _builds(item)}
        else:
            warm_up(session.items, planner.lines.seconds)
        gc.freeze()
        sys.dont_write_bytecode = True

        def altered(job: Job) -> None:
            path = self.root / job.mutant.path
            for function, code in exchanges(
                functions.get(job.mutant.path, ()), path, job.mutant.text
            ):
                function.__code__ = code
            if module_of(job.mutant) not in sys.modules:
                import_altered(module_of(job.mutant), path, job.mutant.text)

        def work(job: Job, journal: Path, whole: bool = False) -> int:
            if not whole:
                altered(job)
            chosen = [items[name] for name in job.tests]
            session.config.pluginmanager.register(Watch(journal, planner.lines.seconds))
            for item, after in zip(chosen, [*chosen[1:], None], strict=bool(chosen)):
                session.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
            return 0

        def planned(jobs: Sequence[Job]) -> Iterator[Job]:
            for job in jobs:
                if not job.mutant.path.endswith(".py"):
                    before = planner.of_room(job.room_tests, job.robots)
                    self.cold.append(replace(job, tests=tuple(before)))
                    continue
                if job.mutant.path.startswith("symgen/"):
                    before = planner.importing(job.mutant, job.room_tests)
                    self.cold.append(replace(job, tests=tuple(before)))
                    continue
                one = replace(job, tests=tuple(planner.tests(job.mutant, job.room_tests)))
                path, text = self.root / job.mutant.path, job.mutant.text
                loaded = functions.get(job.mutant.path, ())
                if module_of(job.mutant) in sys.modules and not exchanges(loaded, path, text):
                    self.cold.append(one)
                else:
                    yield one

        serve(self.jobs, planned, work, self.processes, planner, self.report)
        self.served = True
        return True


def module_of(mutant: Mutant) -> str:
    """Return the name of the module of a mutant."""
    return mutant.path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def serve(
    jobs: Sequence[Job],
    planned: Callable[[Sequence[Job]], Iterator[Job]],
    work: Callable[..., int],
    processes: int,
    planner: Planner,
    report: Report,
) -> None:
    """Run jobs; one that a test notices which fails without any mutant runs again without it.

    Args:
        jobs: mutants.
        planned: gives them their tests.
        work: runs the tests of a job; `whole` leaves the mutant out.
        processes: children at a time.
        planner: knows the tests that fail without any mutant.
        report: called with each outcome.
    """
    while jobs:
        again = list[Job]()
        for job, outcome in ended(planned(jobs), work, processes):
            by = outcome.by
            if by and by not in planner.sound | planner.broken:
                single = replace(job, tests=(by,))
                (_, check), *_ = ended([single], partial(work, whole=True), 1)
                (planner.broken if check.noticed else planner.sound).add(by)
            if by in planner.broken:
                again.append(job)
                continue
            if by:
                planner.noticed(job.mutant, by)
            report(job, outcome)
        jobs = again


def serve_cold(
    root: Path, jobs: Sequence[Job], planner: Planner, processes: int, report: Report
) -> None:
    """Run mutants that take effect at import, in processes that import the altered text.

    Args:
        root: where the tests are collected.
        jobs: mutants with their tests.
        planner: of these tests.
        processes: children at a time.
        report: called with each outcome.
    """
    files_as_they_are = {root / job.mutant.path: job.mutant.whole for job in jobs}

    def work(job: Job, journal: Path, whole: bool = False) -> int:
        path = root / job.mutant.path
        enter(root)
        if path.suffix != ".py":  # a template: what reads it may be another process
            for file, text in files_as_they_are.items():  # another mutant may have left its text
                file.write_text(text, encoding="utf-8")
            path.write_text(job.mutant.whole if whole else job.mutant.text, encoding="utf-8")
        elif not whole:
            import_altered(module_of(job.mutant), path, job.mutant.text)
        files = list(dict.fromkeys(name.split("::")[0] for name in job.tests))
        watch = Watch(journal, planner.lines.seconds)
        return int(pytest.main([*QUIET, *files], plugins=[watch, _Chosen(job.tests)]))

    def planned(jobs: Sequence[Job]) -> Iterator[Job]:
        for job in jobs:
            tests = tuple(t for t in job.tests if t not in planner.broken)
            if tests:
                yield replace(job, tests=tests)
            else:
                report(job, Ended(False, "", 0))

    serve(jobs, planned, work, processes, planner, report)


def enter(root: Path) -> None:
    """Make the copy of the repository the place of imports and of the process."""
    os.chdir(root)
    for name in [n for n in sys.modules if n.split(".")[0] in {"tests", "runtime", "symgen"}]:
        del sys.modules[name]
    sys.path.insert(0, str(root))
    sys.dont_write_bytecode = True


def warm_up(items: Sequence[pytest.Item], seconds: Mapping[str, float]) -> None:
    """Make the fixtures that most tests need once for all children.

    Args:
        items: collected tests; the fastest one that needs a fixture runs.
        seconds: CPU time by test [s].
    """
    chosen = list[pytest.Item]()
    for name in WARM:
        some = [i for i in items if name in getattr(i, "fixturenames", ())]
        if some:
            chosen.append(min(some, key=lambda i: seconds.get(i.nodeid, 1.0)))
    for item, after in zip(chosen, [*chosen[1:], items[0]], strict=True):
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)


def _builds(item: pytest.Item) -> bool:
    """Whether a test needs a library that the tests build, besides the FR3."""
    names = set(getattr(item, "fixturenames", ()))
    return "robot" in names or ("root" in names and "fr3" not in names)


class _Chosen:
    """Pytest plugin: only these tests, in this order."""

    def __init__(self, names: Sequence[str]) -> None:
        self.place = {name: k for k, name in enumerate(names)}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = [item for item in items if item.nodeid in self.place]
        items.sort(key=lambda item: self.place[item.nodeid])
