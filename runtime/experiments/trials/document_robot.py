"""True robot of the document: the URDF with link 7 twice as heavy, at full precision.

I_com of link 7 is 2·I_com,URDF + 1e-4·1, because that of the URDF is nearly singular.
Source: errata to Table B.4.
"""

import numpy as np

from runtime.errors import IdentificationError
from runtime.library import Array, Library

ROBOT = "fr3"
LINK_7 = (
    *(1.2542865724, 5.6726134989e-3, 1.0819716922e-2, -2.0273441638e-2, 9.4286696773e-4),
    *(8.0771244614e-4, 3.3885162663e-4, -9.7599036040e-5, 1.8297790402e-4, 3.4976400656e-4),
)
"""π of link 7 [kg, kg·m, kg·m²]."""


def document_robot(lib: Library) -> Array:
    """Parameters π (70,) of the true robot [kg, kg·m, kg·m²]."""
    if lib.name != ROBOT:
        raise IdentificationError(
            f"expected the robot '{ROBOT}' of the document, got '{lib.name}'; "
            f"run: python -m symgen build {ROBOT}"
        )
    return np.concatenate([lib.pi0[: -len(LINK_7)], LINK_7])
