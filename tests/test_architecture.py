"""The house: import contracts, length of modules, and what run time may not know."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import FIRST, REPOSITORY

MODULES = sorted(
    path for package in ("symgen", "runtime") for path in (REPOSITORY / package).rglob("*.py")
)
LONGEST = 320


def test_import_contracts() -> None:
    """Oracle: import-linter with the contracts of pyproject.toml."""
    program = shutil.which("lint-imports", path=str(Path(sys.executable).parent))
    if program is None:
        pytest.skip("import-linter is not installed: pip install symgen[test]")
    run = subprocess.run(
        [program, "--no-cache"], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]


@pytest.mark.parametrize("path", MODULES, ids=lambda p: p.relative_to(REPOSITORY).as_posix())
def test_modules_are_short(path: Path) -> None:
    """Property: a module holds one responsibility; longer ones become a folder."""
    lines = len(path.read_text(encoding="utf-8").splitlines())
    assert lines <= LONGEST, f"{lines} lines"


def test_modules_are_found() -> None:
    """Property: the tests above look at the right folders."""
    names = {path.relative_to(REPOSITORY).as_posix() for path in MODULES}
    assert {"symgen/emit/ssa.py", "runtime/library/library.py"} <= names


def test_the_longest_tests_are_there() -> None:
    """Property: the names by which files of tests come first are names of files."""
    missing = [name for name in FIRST if not (Path(__file__).parent / name).is_file()]
    assert not missing
    assert len(set(FIRST)) == len(FIRST)


def test_run_time_needs_no_build_tool() -> None:
    """Property: loading and computing imports neither symgen nor casadi nor pinocchio."""
    code = (
        "import sys, runtime, runtime.library\n"
        "print([m for m in ('symgen', 'casadi', 'pinocchio', 'mujoco') if m in sys.modules])"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == "[]"


def test_run_time_names_no_build_tool() -> None:
    """Property: no import of symgen or casadi in runtime, hidden in a function or not."""
    pattern = re.compile(r"^\s*(?:import|from)\s+(?:symgen|casadi)\b", re.MULTILINE)
    guilty = [
        path.relative_to(REPOSITORY).as_posix()
        for path in MODULES
        if path.is_relative_to(REPOSITORY / "runtime")
        and pattern.search(path.read_text(encoding="utf-8"))
    ]
    assert guilty == []
