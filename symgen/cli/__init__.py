"""`python -m symgen build | check | clean | describe | list | proxies`: sentences out.

One module per group of commands; importing it registers them.
"""

import sys

from symgen.cli import make, proxies, show
from symgen.cli.common import app
from symgen.errors import SymgenError

__all__ = ["app", "main", "make", "proxies", "show"]


def main() -> None:
    """Run the command line; a `SymgenError` becomes one sentence and exit code 2."""
    try:
        app()
    except SymgenError as error:
        print(f"symgen: {error}", file=sys.stderr)
        raise SystemExit(2) from None
