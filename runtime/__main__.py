"""`python -m runtime`."""

import sys

try:
    from runtime.cli import main
except KeyboardInterrupt:  # importing takes a second or two, time enough for a change of mind
    sys.stderr.write("runtime: interrupted\n")
    raise SystemExit(130) from None

if __name__ == "__main__":
    main()
