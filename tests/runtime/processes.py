"""The environment of the processes that tests start."""

import os
from pathlib import Path

import runtime

# One thread per process: two test processes on two cores would otherwise wait for each other.
QUIET = os.environ | {
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONPATH": str(Path(runtime.__file__).parents[1]),
}
