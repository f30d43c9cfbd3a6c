"""Linear algebra, filters and distributions of SciPy without the start-up time of its packages.

`import scipy.linalg, scipy.signal, scipy.special` takes most of a second. The compiled extensions
in them load within milliseconds and compute the same digits. What this room leaves out is imported
from SciPy at the place of use.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

__all__ = ["Array"]
