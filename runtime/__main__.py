"""`python -m runtime`."""

import sys

if __name__ == "__main__":
    try:
        from runtime.cli import main

        main()
    except KeyboardInterrupt:  # while the packages load: a command itself answers Ctrl-C
        sys.stderr.write("runtime: interrupted\n")
        sys.exit(130)
