"""`python -m runtime`."""

import sys

if __name__ == "__main__":
    try:
        from runtime.cli import main

        main()
    except KeyboardInterrupt:  # while the packages load: a command itself answers Ctrl-C
        print("runtime: interrupted", file=sys.stderr)
        sys.exit(130)
