"""`python -m symgen`."""

import sys

if __name__ == "__main__":
    try:
        from symgen.cli import main

        main()
    except KeyboardInterrupt:  # while the packages load: a command itself answers Ctrl-C
        print("symgen: interrupted", file=sys.stderr)
        sys.exit(130)
