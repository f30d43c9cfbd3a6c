"""Tables and lines in files and pipes: what rich writes there."""

import io
import subprocess
import sys

import pytest
from rich.console import Console
from rich.progress import Progress

from runtime.cli.grid import Grid
from runtime.cli.plain_console import _LINE, PlainConsole
from tests.conftest import REPOSITORY

PLAIN = (
    Grid(("a", "before %"), (("joint1", "1.25"), ("overall", "")), "fr3, map: error", True, True),
    Grid(("model", "torque error on test data %"), (("URDF", "6.032"), ("identified", "0.765"))),
    Grid(("a",), (("b",),), "odd"),
    Grid(("a", "b", "c"), (), "no rows"),
)
BY_RICH = (
    Grid(("joint", "x"), (("[bold]j[/bold]", "1"),), folds=True),
    Grid(("joint", "x"), (("Gelenk ä", "1"),)),
    Grid(("joint", "x"), (("a:warning:", "1"),)),
    Grid(("joint", "x"), (("j" * 90, "1"),), folds=True),
    Grid(("joint", "x"), (("j", "1"),), "a title that is longer than the table"),
)


def by_rich(thing: object, **options: bool) -> str:
    """Text that rich writes to a file of 80 columns."""
    file = io.StringIO()
    Console(file=file, width=80).print(thing, **options)
    return file.getvalue()


@pytest.mark.parametrize("grid", PLAIN)
def test_plain_table_is_that_of_rich(grid: Grid) -> None:
    """Oracle: rich, character by character."""
    assert grid.plain(80) == by_rich(grid)


@pytest.mark.parametrize("grid", BY_RICH)
def test_other_tables_are_left_to_rich(grid: Grid, monkeypatch, capsys) -> None:
    """Property: markup, wide characters, names of emoji and lines that are too long."""
    assert grid.plain(80) is None
    monkeypatch.setenv("COLUMNS", "80")
    PlainConsole().print(grid)
    assert capsys.readouterr().out == by_rich(grid)


@pytest.mark.parametrize(
    "text",
    [
        *("", "status: converged: 3 steps", "α = 5 % [x] " + "y" * 200, "a  b ", " a"),
        *("tab\there", "bell\a", "a :warning: b", "/a:b:c", "two\nlines"),
    ],
)
def test_line_is_that_of_rich(text: str, capsys) -> None:
    """Oracle: rich, for lines that are written as they are and for those that it changes."""
    PlainConsole().print(text, **_LINE)
    assert capsys.readouterr().out == by_rich(text, **_LINE)


def test_bars_of_rich_run_on_it(capsys) -> None:
    """Oracle: what rich writes without a terminal, with a line printed meanwhile."""
    texts = []
    for console in (PlainConsole(), Console(width=80)):
        with Progress(console=console, transient=True) as bar:
            bar.update(bar.add_task("x", total=2), completed=1)
            console.print("meanwhile", **_LINE)
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1] == "meanwhile\n\n"


def test_identify_in_a_pipe_loads_no_rich(tmp_path) -> None:
    """Property: tables, lines and progress of `identify` in a pipe need nothing of rich."""
    out = str(tmp_path / "out")
    words = ["symgen", "identify", "fr3_simulated", "--no-report", "--out", out]
    run = (
        f"import sys; sys.argv = {words!r}\nfrom runtime.cli import main\n"
        "try:\n    main()\nfinally:\n"
        "    print(sorted({'rich', 'fractions'} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", run],
        cwd=REPOSITORY,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr.splitlines()[-1] == "[]"
    assert "torque error on test data" in done.stdout
    assert done.stdout.count("┡") == 2
