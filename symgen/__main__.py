"""`python -m symgen`: the console command `symgen`, where its script is not on the path."""

import sys

if __name__ == "__main__":
    try:
        from symgen.cli.console import main

        main()
    except KeyboardInterrupt:  # while the packages load: a command itself answers Ctrl-C
        sys.stderr.write("symgen: interrupted\n")
        sys.exit(130)
