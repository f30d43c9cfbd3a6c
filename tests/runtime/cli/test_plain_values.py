"""Values of options: what Typer would return, without its conversion where that changes nothing."""

from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from runtime.cli import plain_values
from runtime.cli.plain_values import PlainGroup
from runtime.cli.renamed_options import RefusingCommand

WORDS = (
    ("a", "b", "--out", "x", "--share", "0.5", "--count", "3", "--yes", "--log", "1", "--log", "2"),
    ("a",),
    ("a", "--count", "-1"),
    ("a", "--count", "many"),
    ("a", "--share", "nan?"),
    ("a", "--present", "no-such-file"),
    (),
)


def answer(words: tuple[str, ...]) -> tuple[int, str]:
    """Exit code and output of a command with options of every kind."""
    app = typer.Typer(cls=PlainGroup, pretty_exceptions_enable=False)
    app.callback()(lambda: None)

    @app.command(cls=RefusingCommand)
    def show(
        logs: list[str],
        out: Path | None = None,
        share: float = 0.25,
        count: Annotated[int, typer.Option(min=0)] = 1,
        yes: bool | None = None,
        log: list[str] | None = None,
        present: Annotated[Path | None, typer.Option(exists=True)] = None,
    ) -> None:
        typer.echo(repr((logs, out, share, count, yes, log, present)))

    result = CliRunner().invoke(app, ["show", *words])
    return result.exit_code, result.output


@pytest.mark.parametrize("words", WORDS)
def test_values_are_those_of_typer(words: tuple[str, ...], monkeypatch) -> None:
    """Oracle: Typer's own conversion, values and messages alike."""
    ours = answer(words)
    monkeypatch.setattr(plain_values, "_Plain", lambda: None)
    assert ours == answer(words)
