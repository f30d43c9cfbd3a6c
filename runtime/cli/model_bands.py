"""The options --payload-band and --model-band: models for which torques keep their limits."""

import numpy as np

from runtime.cli.common import numbers_option
from runtime.errors import RuntimeFault
from runtime.estimators.convex import prior_of
from runtime.estimators.convex.bodies import bodies_of
from runtime.estimators.prior_file import TRUST
from runtime.estimators.regression.residuals import NORMAL_95
from runtime.excitation.limits.carried_body import CarriedBody
from runtime.identification.payload.body import mount_of
from runtime.library import Array, Library
from runtime.library.parameters import link_columns


def band_of(
    lib: Library, payload: str | None, model: str | None, body: CarriedBody | None
) -> tuple[float, ...]:
    """Half-widths of the parameters of all links by both options.

    Returns (10 L,) [kg, kg·m, kg·m²].
    """
    if payload is None and model is None:
        return ()
    band = np.zeros(len(lib.pi0))
    if payload is not None:
        band += band_of_payload(lib, payload, body)
    if model is not None:
        band += band_of_prior(lib, model)
    return tuple(band.tolist())


def band_of_prior(lib: Library, trust: str) -> Array:
    """The 95 % intervals of all parameters under the inertial prior around the URDF.

    σ² are the diagonal of (κ B)⁻¹, with B the curvature of the prior (`posterior_spread`).

    Returns (10 L,) [kg, kg·m, kg·m²].
    """
    try:
        kappa = TRUST[trust] if trust in TRUST else float(trust)
    except ValueError:
        kappa = 0.0
    if not 0 < kappa < np.inf:
        raise RuntimeFault(
            f"--model-band needs {', '.join(TRUST)} or a trust above 0, got '{trust}'"
        )
    root = bodies_of(lib).spread(prior_of(lib).centre)
    return np.asarray(NORMAL_95 * np.sqrt((root**2).sum(axis=2) / kappa).ravel())


def band_of_payload(lib: Library, text: str, body: CarriedBody | None) -> Array:
    """Half-widths of the parameters of the link with the payload.

    Masses of M in all, at places p with |p_i − c_i| ≤ r, change m by M, m c_i by M (|c_i| + r), and
    the inertia by M (|p|² 1 − p pᵀ) at most, entry by entry.

    Returns (10 L,) [kg, kg·m, kg·m²].
    """
    mass, reach = numbers_option(text, 2, "--payload-band")
    if not (0 < mass < np.inf and 0 <= reach < np.inf):
        raise RuntimeFault(
            f"--payload-band needs a mass above 0 kg and a reach from 0 m up, got '{text}'"
        )
    mount = mount_of(lib)
    link, centre = mount.index, mount.translation
    if body is not None:
        link = body.link
        centre = np.array(body.pi[1:4]) / body.pi[0] if body.pi[0] > 0 else centre
    x, y, z = np.abs(centre) + reach
    moments = [y * y + z * z, x * x + z * z, x * x + y * y, x * y, x * z, y * z]
    band = np.zeros(len(lib.pi0))
    band[link_columns(link)] = mass * np.array([1.0, x, y, z, *moments])
    return band
