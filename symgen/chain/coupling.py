"""Linear couplings of joints: q_all = A q + b with the independent coordinates q.

A row is x_d = Σ_m c_m x_m + o, from <mimic> or from a mechanism file. The masters of a row may be
dependent themselves; substitution from row to row gives A and b, and a cycle of rows is refused.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from runtime.common.records import Name, Record
from symgen.chain.document import MOVING, Document, listing, numbers
from symgen.errors import UrdfError

MatrixRows = tuple[tuple[float, ...], ...]
Vector = tuple[float, ...]

_FACTORS = (1e-9, 1e9)  # sizes of factors other than 0: products and quotients of others overflow
_SINGULAR = 1e-9  # reciprocal condition below which named joints do not determine the others


class CouplingRow(Record, frozen=True):
    """Position of a dependent joint as an affine function of others, x = Σ of[m] x_m + offset."""

    joint: Name  # name of the dependent joint
    of: dict[str, float]  # master joint → factor
    offset: float = 0.0  # rad or m


@dataclass(frozen=True, slots=True)
class Coupling:
    """q_all = A q + b of N joints, n of them independent."""

    independent: tuple[int, ...]  # (n,) indices of the independent joints, in the order of q
    matrix: MatrixRows  # (N, n) A, a unit row for every independent joint
    offset: Vector  # (N,) b [rad, m]

    def masters(self, joint: int) -> list[int]:
        """Columns of A that move a joint."""
        return [k for k, factor in enumerate(self.matrix[joint]) if factor]


def mimic_rows(document: Document) -> Iterator[CouplingRow]:
    """Rows of all <mimic> elements of moving joints, in document order."""
    for name, element in document.joints.items():
        node = element.find("mimic")
        if node is None or document.kind(name) not in MOVING:
            continue
        master = node.get("joint")
        if not master:
            raise UrdfError(
                f"the <mimic> of joint '{name}' names no joint; write <mimic joint=…> or remove it"
            )
        factor, offset = (
            float(numbers(node.get(key, default), 1, f"joint '{name}': mimic {key}")[0])
            for key, default in (("multiplier", "1"), ("offset", "0"))
        )
        yield CouplingRow(name, {master: factor}, offset)


def read_coupling(
    joints: tuple[str, ...], rows: Iterable[CouplingRow], independent: tuple[str, ...] = ()
) -> Coupling | None:
    """A and b of coupling rows."""
    by_joint: dict[str, CouplingRow] = {}
    for row in rows:
        _check_row(row, joints)
        if row.joint in by_joint:
            raise UrdfError(f"joint '{row.joint}' has two couplings; keep one of them")
        by_joint[row.joint] = row
    if not by_joint:
        if independent and set(independent) != set(joints):
            raise UrdfError(
                f"independent names {listing(independent)}, but no coupling determines the other "
                "joints; add [[coupling]] or [[loop]], or leave independent out"
            )
        return None
    free = tuple(name for name in joints if name not in by_joint)
    if not free:
        raise UrdfError(
            f"every joint follows another one: {_cycle(by_joint, joints[0])}; make one of them "
            "independent"
        )
    table = _substituted(joints, by_joint, free)
    *columns, offset = np.array([table[name] for name in joints]).T
    matrix = np.stack(columns, axis=1)
    if independent:
        free, matrix, offset = _solved(joints, independent, free, matrix, offset)
    places = tuple(joints.index(name) for name in free)
    return Coupling(places, tuple(map(tuple, matrix.tolist())), tuple(offset.tolist()))


def require_joints(
    stated: Iterable[str], joints: Collection[str], where: str, remedy: str = ""
) -> None:
    """Refuse a name that is not one of a moving joint."""
    for name in stated:
        if name not in joints:
            raise UrdfError(
                f"{where} names '{name}', which is not a moving joint of this robot; its moving "
                f"joints are {listing(joints)}{remedy}"
            )


def _check_row(row: CouplingRow, joints: tuple[str, ...]) -> None:
    what = f"the coupling of joint '{row.joint}'"
    require_joints([row.joint], joints, "a coupling", ": correct the name, or remove the coupling")
    require_joints(row.of, joints, what, f": correct the name, or fix '{row.joint}' with --lock")
    if not abs(row.offset) <= _FACTORS[1]:
        raise UrdfError(
            f"{what} has the offset {row.offset:g}, expected a number "
            f"of rad or m below {_FACTORS[1]:g}; correct it"
        )
    for name, factor in row.of.items():
        if not (factor == 0 or _FACTORS[0] <= abs(factor) <= _FACTORS[1]):
            raise UrdfError(
                f"{what} multiplies '{name}' by {factor:g}, expected "
                f"0 or a factor from {_FACTORS[0]:g} to {_FACTORS[1]:g}; correct it"
            )


def _substituted(
    joints: tuple[str, ...], rows: Mapping[str, CouplingRow], free: tuple[str, ...]
) -> dict[str, np.ndarray]:
    """Joint → its factors of the free joints, then its offset, (n + 1,)."""
    table = dict(zip(free, np.eye(len(free), len(free) + 1), strict=True))
    pending = [name for name in joints if name in rows]
    while pending:
        ready = [name for name in pending if all(m in table for m in rows[name].of)]
        if not ready:
            raise UrdfError(
                f"the couplings form a cycle: {_cycle(rows, pending[0])}; make one of these joints "
                "independent"
            )
        for name in ready:
            alone = np.append(np.zeros(len(free)), rows[name].offset)
            table[name] = sum((f * table[m] for m, f in rows[name].of.items()), alone)
        pending = [name for name in pending if name not in table]
    return table


def _cycle(rows: Mapping[str, CouplingRow], start: str) -> str:
    """A cycle of dependences as text: "a follows b, b follows a"."""
    path = [start]
    while path[-1] in rows:
        path.append(next((m for m in rows[path[-1]].of if m in rows), ""))
        if path[-1] in path[:-1]:
            path = path[path.index(path[-1]) :]
            break
    return ", ".join(f"'{a}' follows '{b}'" for a, b in pairwise(path))


def _solved(
    joints: tuple[str, ...],
    wanted: tuple[str, ...],
    free: tuple[str, ...],
    matrix: np.ndarray,
    offset: np.ndarray,
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """The same coupling by other independent joints: x_w = A_w q + b_w is solved for q."""
    require_joints(wanted, joints, "independent")
    named = tuple(dict.fromkeys(wanted))
    if set(named) == set(free):  # only another order, without rounding
        return named, matrix[:, [free.index(name) for name in named]], offset
    places = [joints.index(name) for name in named]
    part = matrix[places]
    if len(named) != len(free) or np.linalg.cond(part) > 1 / _SINGULAR:
        raise UrdfError(
            f"the independent joints {listing(named)} do not determine the others; this mechanism "
            f"has {len(free)} of them, such as {listing(free)}"
        )
    turned = matrix @ np.linalg.inv(part)
    turned[places] = np.eye(len(named))
    shifted = offset - turned @ offset[places]
    shifted[places] = 0.0
    return named, turned, shifted
