"""Quantiles of the χ² distribution."""

from importlib import import_module

from runtime.numerics.extension import extension

_special = extension("scipy.special._special_ufuncs", ("gammainccinv",)) or import_module(
    "scipy.special"
)


def chi2_quantile(freedom: float, above: float) -> float:
    """The x that χ² exceeds with a given probability: 2 Q⁻¹(k/2, p), `scipy.special.chdtri`.

    Args:
        freedom: k, positive.
        above: p, between 0 and 1.

    Returns:
        x.
    """
    return 2.0 * float(_special.gammainccinv(freedom / 2.0, above))
