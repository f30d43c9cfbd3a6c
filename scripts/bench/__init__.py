"""Measurements; a script runs BLAS on one thread and finds the packages beside it."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
if Path(sys.argv[0]).resolve().parent == ROOT / "scripts":  # before NumPy is imported
    for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[_name] = "1"
    sys.path.insert(1, str(ROOT))
