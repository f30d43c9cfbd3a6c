"""Base parameters: the combinations β = K π that motion can reveal, τ = Y π = Y_b β.

`numeric_base` samples the regressor and decides its rank by a gap in the singular values;
`regrouped_base` is the symbolic recursion of Gautier & Khalil (Table 3.2 with Rules 1 and 2),
an independent check for serial arms with revolute joints in modified DH form.
Source: document Sec. 3.2; Gautier & Khalil, IEEE T-RA 6(3), 1990.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.chain import Chain, Joint
from symgen.errors import RankError
from symgen.mechanics.inertia import N_PARAMETERS, PI_NAMES

Array = NDArray[np.float64]

SILENT_COLUMN = 1e-11
"""Columns this much smaller than the largest are round-off; normalising them would invent one."""
CLEAR_GAP = 1e3
"""Ratio of neighbouring singular values that counts as the edge of the row space."""
ROUNDING = 1e-13
"""Singular values relative to the largest below which geometry leaves nothing, only arithmetic."""
_SAMPLES_PER_COLUMN = 4
_SNAP_DIGITS = 12
_SNAP_WITHIN = 2e-14


@dataclass(frozen=True, slots=True)
class BaseParameters:
    """β = K π and how sure the rank decision was.

    Attributes:
        columns: indices into π of the independent columns; Y_b = Y[:, columns].
        matrix: K, (n_b, 10 n), identity on `columns`.
        smallest_kept: last singular value inside the row space, relative to the largest.
        largest_dropped: first one outside, relative to the largest.
    """

    columns: tuple[int, ...]
    matrix: Array
    smallest_kept: float
    largest_dropped: float

    @property
    def lossless(self) -> bool:
        """What was dropped is rounding: Y_b β is Y π to the last digits."""
        return self.largest_dropped < ROUNDING

    @property
    def gap(self) -> float:
        """How many times the last kept singular value exceeds the first dropped one."""
        return self.smallest_kept / self.largest_dropped


def numeric_base(
    chain: Chain, regressor: Callable[[Array, Array, Array], Array], seed: int = 0
) -> BaseParameters:
    """Rank and regrouping from a sampled regressor W = [Y_1; Y_2; …].

    W's columns are normalised, the rank is the first place where neighbouring singular values
    differ by more than `CLEAR_GAP`, the independent columns are picked greedily in the order
    that the regrouping rules prefer, and K solves W_b K = W.

    Args:
        chain: n joints.
        regressor: (q, dq, ddq), each (N, n), → (N, n, 10 n).
        seed: of the random states.

    Raises:
        RankError: the singular values fall without a clear gap.
    """
    n = len(chain.joints)
    rng = np.random.default_rng(seed)
    samples = _SAMPLES_PER_COLUMN * N_PARAMETERS * n
    # Turns and travels of order one: revolute states in rad, prismatic ones in m.
    q = rng.uniform(-np.pi, np.pi, (samples, n))
    dq, ddq = rng.normal(0, 2, (2, samples, n))
    w = regressor(q, dq, ddq).reshape(-1, N_PARAMETERS * n)
    norms = np.linalg.norm(w, axis=0)
    heard = np.flatnonzero(norms > SILENT_COLUMN * norms.max())
    unit = w[:, heard] / norms[heard]
    sigma = np.linalg.svd(unit, compute_uv=False)
    sigma = np.append(sigma / sigma[0], np.finfo(float).eps)
    falls = np.flatnonzero(sigma[:-1] > CLEAR_GAP * sigma[1:])
    if falls.size == 0:
        raise RankError(
            "the singular values of the regressor fall without a gap of "
            f"{CLEAR_GAP:g} (smallest {sigma[-2]:.1e}), so the number of base parameters is "
            "undecided; if the URDF rounds its angles, state it with --snap 1e-4"
        )
    rank = int(falls[0]) + 1
    order = sorted(range(len(heard)), key=lambda k: _preference(chain, int(heard[k])))
    chosen = _independent(unit, order, rank)
    columns = tuple(sorted(int(heard[k]) for k in chosen))
    k_heard = np.linalg.lstsq(w[:, columns], w[:, heard], rcond=None)[0]
    matrix = np.zeros((rank, N_PARAMETERS * n))
    matrix[:, heard] = _tidied(np.asarray(k_heard, dtype=float))
    matrix[:, columns] = np.eye(rank)
    return BaseParameters(columns, matrix, float(sigma[rank - 1]), float(sigma[rank]))


def _preference(chain: Chain, column: int) -> tuple[int, int]:
    """Sort key: columns that the regrouping rules keep come first, then m, m·c_axis and one moment.

    About a joint axis z, Table 3.2 moves m, mZ and YY into the parent; x and y go cyclically.
    """
    link, parameter = divmod(column, N_PARAMETERS)
    axis = int(np.argmax(np.abs(chain.joints[link].axis)))
    moved = {"m", ("mX", "mY", "mZ")[axis], ("ZZ", "XX", "YY")[axis]}
    return (PI_NAMES[parameter] in moved, column)


def _independent(unit: Array, order: list[int], rank: int) -> list[int]:
    """First `rank` columns in the given order that none of their predecessors span."""
    basis = np.zeros((unit.shape[0], 0))
    residuals: list[tuple[float, int]] = []
    for k in order:
        v = unit[:, k]
        for _ in range(2):  # twice is enough for orthogonality to rounding
            v = v - basis @ (basis.T @ v)
        length = float(np.linalg.norm(v))
        if length > 1.0 / CLEAR_GAP**1.5 and basis.shape[1] < rank:
            basis = np.column_stack([basis, v / length])
            residuals.append((length, k))
    if len(residuals) < rank:
        raise RankError(
            f"found {len(residuals)} independent columns where the singular values promise {rank}; "
            "if the URDF rounds its angles, state it with --snap 1e-4"
        )
    return [k for _, k in residuals]


def _tidied(matrix: Array) -> Array:
    """Zeros and short decimals (products of the URDF's lengths) freed from rounding.

    Makes K the same on every machine where the geometry is given in decimals.
    """
    rounded = np.round(matrix, _SNAP_DIGITS) + 0.0
    close = np.abs(matrix - rounded) < _SNAP_WITHIN * np.maximum(1.0, np.abs(matrix))
    return np.where(close, rounded, matrix)


def describe_combination(names: list[str], row: list[float]) -> str:
    """One row of K in words: `link1.ZZ + link2.YY - 0.3 link3.m`."""
    terms = [(x, name) for x, name in zip(row, names, strict=True) if x]
    terms.sort(key=lambda term: term[0] != 1.0)
    text = " ".join(
        f"{'-' if x < 0 else '+'} {'' if abs(x) == 1 else f'{abs(x):.6g} '}{name}"
        for x, name in terms
    )
    return text.removeprefix("+ ")


def regrouped_base(chain: Chain) -> tuple[tuple[int, ...], Array]:
    """Columns and K by the recursion of Table 3.2 with Rules 1 and 2.

    Raises:
        RankError: the chain is not a serial arm of revolute joints in modified DH form.
    """
    n = len(chain.joints)
    size = N_PARAMETERS * n
    rows = {
        (i, name): np.eye(size)[N_PARAMETERS * i + k]
        for i in range(n)
        for k, name in enumerate(PI_NAMES)
    }
    for i in range(n - 1, 0, -1):
        c, s, a, d = _modified_dh(chain.joints[i], i - 1)
        yy, mz, m = rows[i, "YY"], rows[i, "mZ"], rows[i, "m"]
        moved = {
            "XX": yy + 2 * d * mz + d**2 * m,
            "YY": c**2 * yy + 2 * d * c**2 * mz + (a**2 + d**2 * c**2) * m,
            "ZZ": s**2 * yy + 2 * d * s**2 * mz + (a**2 + d**2 * s**2) * m,
            "XY": a * s * mz + a * d * s * m,
            "XZ": -a * c * mz - a * d * c * m,
            "YZ": c * s * yy + 2 * d * c * s * mz + d**2 * c * s * m,
            "mX": a * m,
            "mY": -s * mz - d * s * m,
            "mZ": c * mz + d * c * m,
            "m": m,
        }
        for name, extra in moved.items():
            rows[i - 1, name] = rows[i - 1, name] + extra
        rows[i, "XX"] = rows[i, "XX"] - yy
        for name in ("YY", "mZ", "m"):
            del rows[i, name]
    _modified_dh(chain.joints[0], -1)
    silent = ["XX", "XY", "XZ", "YY", "YZ", "mZ", "m"]  # Rule 1
    if np.allclose(np.cross(_first_axis(chain), chain.gravity), 0):
        silent += ["mX", "mY"]  # Rule 2
    for name in silent:
        del rows[0, name]
    keys = sorted(rows, key=lambda key: (key[0], PI_NAMES.index(key[1])))
    columns = tuple(N_PARAMETERS * i + PI_NAMES.index(name) for i, name in keys)
    return columns, np.array([rows[key] for key in keys])


def _first_axis(chain: Chain) -> Array:
    return np.array(chain.joints[0].rotation) @ np.array(chain.joints[0].axis)


def _modified_dh(joint: Joint, parent: int) -> tuple[float, float, float, float]:
    """cos α, sin α, a, d of a joint placed by Rot_x(α) Trans_x(a) Trans_z(d)."""
    r, p = np.array(joint.rotation), np.array(joint.translation)
    c, s = r[2, 2], r[2, 1]
    d = -s * p[1] + c * p[2]
    in_form = (
        joint.kind != "prismatic"
        and joint.parent == parent
        and joint.axis == (0.0, 0.0, 1.0)
        and np.allclose(r, [[1, 0, 0], [0, c, -s], [0, s, c]], atol=1e-9)
        and np.allclose(p[1:], [-s * d, c * d], atol=1e-9)
    )
    if not in_form:
        raise RankError(
            f"joint '{joint.name}' is not a revolute joint in modified DH form, which the "
            "symbolic regrouping of Table 3.2 needs; use the numeric one"
        )
    return float(c), float(s), float(p[0]), float(d)
