"""Functions φ of s = t/t_f that vanish at both ends with two derivatives: q = home + Σ a_m φ_m(s).

On request the third derivative vanishes at both ends too; the polynomials gain two degrees then.
Another package adds a basis by an entry point of the group "symgen.bases".
"""

from runtime.errors import IdentificationError
from runtime.excitation.motion.family import Basis, BasisFamily
from runtime.excitation.motion.fourier import Cosine
from runtime.excitation.motion.spline import Transfer
from runtime.registry import Registry

COSINE = Cosine()
"""The default basis."""
BASES = Registry(
    "symgen.bases",
    BasisFamily,
    "basis",
    {
        "cosine": "runtime.excitation.motion.fourier:COSINE_FAMILY",
        "fourier": "runtime.excitation.motion.fourier:FOURIER_FAMILY",
        "bspline": "runtime.excitation.motion.spline:SPLINE_FAMILY",
    },
)
"""All bases of excitation motions by name; these return home."""


def basis_of(name: str, zero_jerk: bool = False) -> Basis:
    """The basis of this name.

    Args:
        name: one of `BASES`, or that of `Transfer`.
        zero_jerk: the third derivative vanishes at both ends, too.

    Returns:
        The basis.

    Raises:
        IdentificationError: the name is unknown.
    """
    if name == Transfer.name:
        return Transfer(zero_jerk)
    if name not in BASES:
        raise IdentificationError(
            f"there is no basis '{name}' of trajectories; choose from {', '.join(BASES)}"
        )
    return BASES[name].make(zero_jerk)
