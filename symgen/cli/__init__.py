"""Commands of the build tool: build, check, clean, describe, inspect, list, proxies.

One module per group of commands; importing it registers them. Casadi and pinocchio are imported
by the commands that compute with them, so that the others run without the extra `build`.
"""

import os
import sys
from inspect import getdoc

from runtime.common.errors import RuntimeFault
from symgen import __version__
from symgen.cli import inspect, make, proxies, show
from symgen.cli.common import app, as_typed, flowing
from symgen.cli.interrupts import lasting_interrupts

INTERRUPTED = 130
"""Exit code that typer makes of a KeyboardInterrupt."""

__all__ = ["app", "inspect", "main", "make", "proxies", "show"]

for command in app.registered_commands:
    command.help = flowing(getdoc(command.callback) or "")


def main() -> None:
    """Run the command line; a `RuntimeFault` is printed as one sentence, with exit code 2."""
    # With a hundred columns a second thread of BLAS only waits, for half a second of processor
    # time. NumPy reads this at its import.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if sys.argv[1:2] == ["--version"]:
        print(f"symgen {__version__}")
        return
    try:
        with lasting_interrupts():
            app()
    except RuntimeFault as error:
        print(f"symgen: {as_typed(str(error))}", file=sys.stderr)
        raise SystemExit(2) from None
    except OSError as error:
        if error.filename is None:
            raise
        place = str(error.filename)
        short = place if len(place) <= 100 else place[:100] + "…"
        print(
            f"symgen: cannot use '{short}' ({error.strerror}); choose another path",
            file=sys.stderr,
        )
        raise SystemExit(2) from None
    except SystemExit as end:
        if end.code == INTERRUPTED:
            print(
                "symgen: interrupted; existing files were not changed",
                file=sys.stderr,
            )
        raise
