"""`python -m symgen`."""

import sys

try:
    from symgen.cli import main
except ModuleNotFoundError as error:
    if error.name not in {"casadi", "pinocchio"}:
        raise
    sys.stderr.write(
        f"symgen: writing the C code of a robot needs the package {error.name}, which is not "
        "installed; run: pip install 'symgen[build]'\n"
    )
    raise SystemExit(2) from None
except KeyboardInterrupt:  # importing takes a second or two, time enough for a change of mind
    sys.stderr.write("symgen: interrupted\n")
    raise SystemExit(130) from None

if __name__ == "__main__":
    main()
