"""Quantiles of the normal and of the χ² distribution."""

from functools import cache
from importlib import import_module
from types import ModuleType

from runtime.numerics.extension import extension

NORMAL_95 = 1.959963984540054
"""Half width of the two-sided 95 % interval of a normal variable in standard deviations."""


def chi2_quantile(freedom: float, above: float) -> float:
    """The x that χ² exceeds with a given probability: 2 Q⁻¹(k/2, p), `scipy.special.chdtri`."""
    return 2.0 * float(_special().gammainccinv(freedom / 2.0, above))


@cache
def _special() -> ModuleType:
    """Loaded at the first quantile of χ², so that the constant costs nothing."""
    name = "scipy.special._special_ufuncs"
    return extension(name, ("gammainccinv",)) or import_module("scipy.special")
