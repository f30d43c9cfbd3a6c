"""End of a process that was one command.

Python takes every module and object apart before it ends, which took 5 % of the processor time of
`identify`. The kernel frees the same memory at once.
"""

import atexit
import os
import sys
import threading
from pathlib import Path


def leave(code: object) -> None:
    """End the process, where it was started for a command and nothing else needs it.

    Returns where another program called the command, a thread still runs, the code is a message, or
    the output cannot be written; the interpreter then ends as usual.
    """
    if not (code is None or isinstance(code, int)) or not _is_command():
        return
    if threading.active_count() > 1:
        return
    try:
        sys.stdout.flush()
        sys.stderr.flush()
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    except (OSError, ValueError):  # closed by the reader, or by the command
        return
    os._exit(code or 0)


def _is_command() -> bool:
    """Whether the main module is `python -m runtime` or the script `symgen`."""
    main = sys.modules["__main__"]
    spec = getattr(main, "__spec__", None)
    if spec is not None:
        return str(spec.name) == "runtime.__main__"
    return Path(getattr(main, "__file__", None) or "").stem == "symgen"
