"""The option --payload-band: payloads that differ from the carried body by a stated mass."""

import numpy as np

from runtime.cli.common import numbers_option
from runtime.errors import RuntimeFault
from runtime.excitation.limits.carried_body import CarriedBody
from runtime.identification.payload.mount import mount_of
from runtime.library import Library
from runtime.library.parameters import link_columns


def band_of_payload(lib: Library, text: str, body: CarriedBody | None) -> tuple[float, ...]:
    """Half-widths of the parameters of the link with the payload.

    Masses of M in all, at places p with |p_i − c_i| ≤ r, change m by M, m c_i by M (|c_i| + r), and
    the inertia by M (|p|² 1 − p pᵀ) at most, entry by entry.

    Args:
        lib: library of the robot.
        text: M [kg] and r [m] with a comma.
        body: the carried body, whose centre is c; None for the tip.

    Returns:
        (10 L,) [kg, kg·m, kg·m²], zero for the other links.

    Raises:
        RuntimeFault: the text is not of this form.
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
    return tuple(band.tolist())
