"""Order of π and λ of one body, and accessors to their parts.

π = (m, m·c, I) with I about the link origin; λ = (μ, c, ω, a, b, c̄). symgen.mechanics.inertia
states the order, the manifest carries it, and this module is the one place of the runtime that
spells it out. π and λ of a robot are flat, (10 n,), link after link.
"""

import numpy as np
from numpy.typing import ArrayLike

from runtime.errors import ShapeError
from runtime.library.arrays import Array

PI_NAMES = ("m", "mX", "mY", "mZ", "XX", "YY", "ZZ", "XY", "XZ", "YZ")
LAM_NAMES = ("mu", "x", "y", "z", "omega_1", "omega_2", "omega_3", "a", "b", "c")
PINOCCHIO_NAMES = ("m", "mX", "mY", "mZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")
N_PARAMETERS = len(PI_NAMES)  # parameters of one body, in π as in λ
MASS, FIRST_MOMENT, INERTIA = 0, slice(1, 4), slice(4, N_PARAMETERS)  # places in π of one body
INERTIA_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # XX, YY, ZZ, XY, XZ, YZ in I
_CENTRE, _ROTATION, _AXES = slice(1, 4), slice(4, 7), slice(7, N_PARAMETERS)


def links(values: Array) -> Array:
    """Rows of one link each, (n, 10), from π, λ or anything that lies like them, (10 n,)."""
    return values.reshape(-1, N_PARAMETERS)


def link_columns(index: int) -> slice:
    """Places of link `index` in π of a robot, (10 n,), and columns of it in the regressor."""
    return slice(N_PARAMETERS * index, N_PARAMETERS * (index + 1))


def mass(pi: Array) -> Array:
    """Mass m, (…), kg, from π of one body or of many, (…, 10)."""
    return np.asarray(pi[..., MASS])


def first_moment(pi: Array) -> Array:
    """First moment m·c, (…, 3), kg·m, from π of one body or of many, (…, 10)."""
    return np.asarray(pi[..., FIRST_MOMENT])


def inertia(pi: Array) -> Array:
    """Inertia (XX, YY, ZZ, XY, XZ, YZ) about the link origin, (…, 6), kg·m², from π, (…, 10)."""
    return np.asarray(pi[..., INERTIA])


def inertia_entries(matrix: Array) -> Array:
    """Entries (XX, YY, ZZ, XY, XZ, YZ), (…, 6), of inertia matrices, (…, 3, 3)."""
    return np.stack([matrix[..., i, j] for i, j in INERTIA_ENTRIES], axis=-1)


def inertia_matrix(entries: ArrayLike) -> Array:
    """Inertia matrices, (…, 3, 3), of entries (XX, YY, ZZ, XY, XZ, YZ), (…, 6)."""
    values = np.asarray(entries, dtype=float)
    matrix = np.empty((*values.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(INERTIA_ENTRIES):
        matrix[..., i, j] = matrix[..., j, i] = values[..., k]
    return matrix


def centre_of_mass(pi: Array) -> Array:
    """Centre of mass c = (m·c)/m, (…, 3), m, from π of one body or of many, (…, 10)."""
    return first_moment(pi) / mass(pi)[..., None]


def pi_from_parts(mass: ArrayLike, first_moment: ArrayLike, inertia: ArrayLike) -> Array:
    """π (10,) of one body from m, m·c and I = XX, YY, ZZ, XY, XZ, YZ about the link origin."""
    pi = np.zeros(N_PARAMETERS)
    pi[MASS], pi[FIRST_MOMENT], pi[INERTIA] = mass, first_moment, inertia
    return pi


def lam_parts(lam: Array) -> tuple[Array, Array, Array, Array]:
    """Parts of λ of one body or of many, (…, 10)."""
    return np.asarray(lam[..., MASS]), lam[..., _CENTRE], lam[..., _ROTATION], lam[..., _AXES]


def lam_from_parts(
    log_mass: ArrayLike, centre: ArrayLike, rotation: ArrayLike, axes: ArrayLike
) -> Array:
    """λ (10,) of one body from μ, c (3,) [m], ω (3,) [rad] and a, b, c̄ (3,) [kg^½·m]."""
    lam = np.zeros(N_PARAMETERS)
    lam[MASS], lam[_CENTRE], lam[_ROTATION], lam[_AXES] = log_mass, centre, rotation, axes
    return lam


def to_pinocchio_order(pi: ArrayLike) -> Array:
    """π per link from [m, mX, mY, mZ, XX, YY, ZZ, XY, XZ, YZ] to pinocchio's order.

    Pinocchio's `toDynamicParameters` is [m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz].

    Args:
        pi: (…, 10 n_links).

    Raises:
        ShapeError: the last axis is not a multiple of 10.
    """
    array = np.asarray(pi, dtype=float)
    if array.ndim == 0 or array.shape[-1] % N_PARAMETERS:
        raise ShapeError(f"pi needs 10 entries per link on its last axis, got shape {array.shape}")
    order = [PI_NAMES.index(name) for name in PINOCCHIO_NAMES]
    rows = array.reshape(*array.shape[:-1], -1, N_PARAMETERS)
    return rows[..., order].reshape(array.shape)
