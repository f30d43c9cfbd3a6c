"""`python -m runtime`."""

import gc
import sys

gc.disable()  # what the import makes stays; `main` starts the collector again
try:
    from runtime.cli import main
except KeyboardInterrupt:  # importing takes a second or two, time enough for a change of mind
    sys.stderr.write("runtime: interrupted\n")
    raise SystemExit(130) from None

if __name__ == "__main__":
    main()
