"""Standard deviations that `identify` reaches with a log of a robot with a free base, or with more.

More of the same motion adds rows in proportion to time, while offsets of sensors stay constant, so
that their share of σ stays, too.
"""

import numpy as np

from runtime.identification.expected_accuracy.expected import Expected, expected_of_root
from runtime.identification.free_base.result import FreeBaseIdentification
from runtime.library.parameters import MASS, N_PARAMETERS

TOTAL_MASS = "total mass"
"""Name of the mass of the robot."""


def expected_of_walk(result: FreeBaseIdentification, seconds: float = 0.0) -> Expected:
    """Standard deviations of the training part, and of some seconds of the same motion after it."""
    evidence = result.evidence
    _, reduced, _, spread = evidence.after(seconds)
    rows = reduced.factor / np.sqrt(evidence.level)
    return expected_of_root(result.lib, result.pi, spread.root, spread.by_kappa.share, rows)


def named_of_walk(result: FreeBaseIdentification, sigma: Expected) -> dict[str, float]:
    """Standard deviations with names: total mass, links, base parameters."""
    total = float(np.linalg.norm(sigma.root[MASS::N_PARAMETERS].sum(axis=0)))
    return {TOTAL_MASS: total} | sigma.by_name(result.lib)
