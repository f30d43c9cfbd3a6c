"""Progress bars outside terminals."""

import io
import subprocess
import sys

import pytest
from rich.console import Console
from rich.progress import Progress

from runtime.cli import progress
from tests.conftest import REPOSITORY


@pytest.mark.parametrize("stopped", [False, True])
def test_bar_in_a_pipe_is_that_of_rich(monkeypatch, stopped: bool) -> None:
    """Oracle: what rich writes to a file, also where the bar is stopped before its end."""
    texts = []
    for make in (progress.counting, lambda: Progress(console=progress.console, transient=True)):
        file = io.StringIO()
        monkeypatch.setattr(progress, "console", Console(file=file, width=80))
        with make() as bar:
            bar.update(bar.add_task("x", total=None, state=""), completed=3, state="y")
            if stopped:
                bar.stop()
        texts.append(file.getvalue())
    assert texts[0] == texts[1] != ""


def test_command_in_a_pipe_loads_no_bar() -> None:
    """Property: rich's bars, and what reads metadata of packages, take a tenth of a short run."""
    code = (
        "import sys\nfrom runtime.cli.identify import identify_command, counting, state\n"
        "with counting(state) as bar:\n    bar.update(bar.add_task('x', total=1, state=''))\n"
        "heavy = {'rich.progress', 'importlib.metadata', 'concurrent.futures', 'numpy.ma'}\n"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    assert run.stderr.strip() == "[]"


def test_sign_in_a_pipe_is_that_of_rich(monkeypatch) -> None:
    """Oracle: what rich writes to a file; its thread and its spinners are left out."""
    texts = []
    signs = (lambda: progress.waiting("working"), lambda: progress.console.status("working"))
    for make in signs:
        file = io.StringIO()
        monkeypatch.setattr(progress, "console", Console(file=file, width=80))
        with make():
            progress.console.print("result")
        texts.append(file.getvalue())
    assert texts[0] == texts[1] == "result\n"
