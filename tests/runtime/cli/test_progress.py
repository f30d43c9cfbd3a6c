"""Progress bars outside terminals."""

import io

import pytest
from rich.console import Console
from rich.progress import Progress

from runtime.cli import common


@pytest.mark.parametrize("stopped", [False, True])
def test_bar_in_a_pipe_is_that_of_rich(monkeypatch, stopped: bool) -> None:
    """Oracle: what rich writes to a file, also where the bar is stopped before its end."""
    texts = []
    for make in (common.counting, lambda: Progress(console=common.console, transient=True)):
        file = io.StringIO()
        monkeypatch.setattr(common, "console", Console(file=file, width=80))
        with make() as bar:
            bar.update(bar.add_task("x", total=None, state=""), completed=3, state="y")
            if stopped:
                bar.stop()
        texts.append(file.getvalue())
    assert texts[0] == texts[1] != ""
