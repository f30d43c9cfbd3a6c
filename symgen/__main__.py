"""`python -m symgen`."""

import sys

if __name__ == "__main__":
    try:
        from symgen.cli import main

        main()
    except KeyboardInterrupt:  # while the packages load: a command itself answers Ctrl-C
        sys.stderr.write("symgen: interrupted\n")
        sys.exit(130)
