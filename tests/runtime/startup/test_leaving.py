"""End of a process: exit code, output and exit functions are those of the interpreter's end."""

import subprocess
import sys

import pytest

from tests.conftest import REPOSITORY

COMMAND = """
import atexit, sys, threading
atexit.register(print, "exit function")
{before}
import runtime.startup.leaving as leaving
sys.modules["__main__"].__spec__ = None
sys.modules["__main__"].__file__ = {file!r}
print("output", end=" ")
sys.stdout.reconfigure(write_through=False)
class Last:
    def __del__(self): print("taken apart")
last = Last()
leaving.leave({code})
raise SystemExit({code})
"""
TAKEN_APART = "exit function\ntaken apart\n"


@pytest.mark.parametrize(
    ("file", "code", "before", "output"),
    [
        ("/bin/symgen", 0, "", "output exit function\n"),
        ("/bin/symgen", 2, "", "output exit function\n"),
        ("/bin/symgen", None, "", "output exit function\n"),
        ("/bin/pytest", 2, "", f"output {TAKEN_APART}"),
        ("/bin/symgen", "'a message'", "", f"output {TAKEN_APART}"),
        (
            "/bin/symgen",
            0,
            "threading.Timer(0.1, print, ['thread']).start()",
            f"output thread\n{TAKEN_APART}",
        ),
    ],
)
def test_the_process_ends_with_its_output_and_code(file, code, before, output) -> None:
    """Property: only a process of its own that has no other thread is ended at once."""
    text = COMMAND.format(file=file, code=code, before=before)
    run = subprocess.run(
        [sys.executable, "-c", text], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert run.stdout == output
    assert run.returncode == (1 if isinstance(code, str) else code or 0)
    assert run.stderr == ("a message\n" if isinstance(code, str) else "")
