"""The nearest consistent inertials that keep the base parameters: a convex projection.

    min Σ_l ‖S_l − S_l⁰‖²   s.t.   K T x = K T x⁰,   m_l = m_l⁰,   P_l(x_l) ⪰ ε P_l^ref

in the coordinates S = L⁻¹ P L⁻ᵀ of a body L Lᵀ like the link's. The distance is the pullback metric
of Lee, Wensing & Park (IEEE T-RO 36(2), 2020), frozen at that body: it does not depend on units,
origins or axes. Masses are kept, since a repair must not invent them. If no consistent bodies have
these base parameters, ‖R K T (x − x⁰)‖, the change of torque, is minimised first.

The new <inertial> blocks are put into the text of the URDF, and every other byte is kept: writing
the document back from its tree would lose comments, white space and the order of attributes.
"""

from dataclasses import dataclass
from typing import Any
from xml.parsers import expat

import casadi as ca
import clarabel
import numpy as np
from scipy import sparse
from scipy.linalg import block_diag

from symgen.errors import InertiaError, UrdfError
from symgen.inspect.base import SampledBase, lumping
from symgen.inspect.model import Body, Model, pi_of, pseudo_of
from symgen.kernel import Array
from symgen.mechanics import inertia

_AXES = "xyz"


def with_bodies(text: str, bodies: dict[str, Body]) -> str:
    """Return the URDF with the <inertial> of the named links replaced."""
    data = text.encode()
    places = _places(data)
    missing = [name for name in bodies if name not in places]
    if missing:
        raise UrdfError(f"link '{missing[0]}' has no <inertial> to replace; add one")
    for name in sorted(bodies, key=lambda name: places[name], reverse=True):
        start, end = places[name]
        blank = data[data.rfind(b"\n", 0, start) + 1 : start].decode()
        indent = blank if not blank.strip() else ""
        data = data[:start] + _block(bodies[name], indent).encode() + data[end:]
    return data.decode()


def _places(data: bytes) -> dict[str, tuple[int, int]]:
    """Position of the first <inertial> of each link: first byte, and one past the last byte."""
    parser = expat.ParserCreate("utf-8")  # the text is UTF-8 now, whatever its header states
    path: list[str] = []
    link, start = "", 0
    places: dict[str, tuple[int, int]] = {}

    def opened(tag: str, attributes: dict[str, str]) -> None:
        nonlocal link, start
        path.append(tag)
        if path == ["robot", "link"]:
            link = attributes.get("name", "")
        if path == ["robot", "link", "inertial"]:
            start = parser.CurrentByteIndex

    def closed(_: str) -> None:
        if path == ["robot", "link", "inertial"] and link not in places:
            # At an end tag the index is that of "</"; at <inertial/> it is that of the start.
            end = data.index(b">", parser.CurrentByteIndex) + 1
            places[link] = (start, end)
        path.pop()

    parser.StartElementHandler, parser.EndElementHandler = opened, closed
    parser.Parse(data, True)
    return places


def _block(body: Body, indent: str) -> str:
    step = "\n" + indent + "  "
    entries = " ".join(
        f'i{_AXES[i]}{_AXES[j]}="{_digits(body.inertia[i, j])}"'
        for i in range(3)
        for j in range(i, 3)
    )
    xyz = " ".join(_digits(x) for x in body.com)
    return (
        f'<inertial>{step}<origin xyz="{xyz}" rpy="0 0 0"/>'
        f'{step}<mass value="{_digits(body.mass)}"/>'
        f"{step}<inertia {entries}/>\n{indent}</inertial>"
    )


def _digits(value: float) -> str:
    return repr(float(value) + 0.0)  # the shortest text that reads back to the same number


FLOOR = 1e-2  # ε: P ⪰ FLOOR · P_ref keeps at least this part of a reference body in every direction
THIN = 1e-2  # least eigenvalue over the sum of Σ_com of the reference of an inconsistent link
ROUND = 0.1  # the same of the body that defines the distance: rounder, so no direction is stiff
KEPT = 1e-7  # relative change of torque up to which β is kept; the cone solver leaves about 1e-9
SLACK = 0.25
"""Part of the smallest torque change that is added to stay near the file: the minimum itself needs
absurd bodies (centres of mass 10 cm away on the FR3 of 2023)."""
STILL = 1e-5  # relative change below which a consistent link is left as written; solvers leave 1e-6
_SVEC = tuple((i, j) for j in range(4) for i in range(j + 1))  # upper triangle (4, 4) by columns
_WEIGHT = np.array([1.0 if i == j else np.sqrt(2.0) for i, j in _SVEC])  # inner product as matrices


@dataclass(frozen=True, slots=True, eq=False)
class Repair:
    """Changed bodies."""

    bodies: dict[str, Body]  # link → body, only for links that changed
    torque_change: float  # ‖Δτ‖ / ‖τ‖ at random states, relative to each joint's torque; 0 if kept
    kept: bool  # True if the base parameters are those of the file


def repair(model: Model, base: SampledBase | None) -> Repair:
    """Project the inertials of all links with mass."""
    links = _links(model)
    projection = _Projection(model, links, base)
    s, change, kept = projection.solve()
    bodies = {
        name: Body.of(
            projection.roots[k] @ _matrix(s[10 * k : 10 * k + 10]) @ projection.roots[k].T
        )
        for k, name in enumerate(links)
        if (s != projection.start)[10 * k : 10 * k + 10].any()
    }
    return Repair(bodies, change, kept)


def _links(model: Model) -> list[str]:
    names = []
    for name, body in model.bodies.items():
        if body.is_empty:
            continue
        if not body.mass > 0:
            raise InertiaError(
                f"link '{name}' has the mass {body.mass:g} kg, which a repair cannot "
                "determine; correct it in the file, then repair the rest"
            )
        names.append(name)
    if not names:
        raise InertiaError("no link of this file has mass, so there is nothing to repair")
    return names


class _Projection:
    """The projection in whitened coordinates s = svec(L⁻¹ P L⁻ᵀ), all links in one vector."""

    def __init__(self, model: Model, links: list[str], base: SampledBase | None) -> None:
        bodies = [model.bodies[name] for name in links]
        # L of each link's metric, and start s⁰ and floor ε P_ref in its coordinates.
        old = np.concatenate([body.pi for body in bodies])
        self.roots = [np.linalg.cholesky(pseudo_of(_nearest(body, ROUND))) for body in bodies]
        pairs = list(zip(self.roots, bodies, strict=True))
        self.start = np.concatenate([_whitened(root, body.pseudo_inertia) for root, body in pairs])
        least = [body.pi if body.is_realisable else _nearest(body, THIN) for body in bodies]
        self._least = FLOOR * np.concatenate(
            [_whitened(root, pseudo_of(pi)) for root, pi in zip(self.roots, least, strict=True)]
        )
        # (10, 10) per link: π from s; its first row is the mass.
        to_pi = [
            np.column_stack([pi_of(root @ _matrix(e) @ root.T) for e in np.eye(10)])
            for root in self.roots
        ]
        self._consistent = np.array([body.is_realisable for body in bodies])
        size = 10 * len(links)
        mass = block_diag(*[block[:1] for block in to_pi])
        self._masses = mass / np.abs(mass).max(axis=1, keepdims=True)
        self._rows = np.zeros((0, size))  # relative change of torque per unit of s
        if base is not None:
            # Torque change R K T Δx in units of the torque itself, ‖R β‖.
            whole = base.parameters.matrix @ lumping(model, base.chain, links)
            beta = whole @ old
            factor = base.factor(beta)
            motion = factor @ whole @ block_diag(*to_pi)
            self._rows = motion / max(float(np.linalg.norm(factor @ beta)), 1e-300)

    def solve(self) -> tuple[Array, float, bool]:
        """s, the relative change of torque, and whether the base parameters are kept."""
        # 1. Least possible change of torque. 2. If it is zero, the nearest s with equal base
        # parameters; else the nearest s within (1 + SLACK) times the least change.
        smallest = self._change(self._cone(None))
        if smallest <= KEPT:
            s = self._on_equalities(self._cone(0.0), np.vstack([self._masses, self._rows]))
            if s is not None:
                return s, 0.0, True
        s = self._on_equalities(self._cone((1 + SLACK) * max(smallest, KEPT)), self._masses)
        if s is None:
            raise InertiaError(
                "the projection is not consistent after rounding; first correct inertials that are "
                "wrong by orders of magnitude"
            )
        return s, self._change(s), False

    def _on_equalities(self, raw: Array, equalities: Array) -> Array | None:
        """s on the equalities, nearly unchanged links restored; None outside the cone."""
        links, start = raw.reshape(-1, 10), self.start.reshape(-1, 10)
        step = np.linalg.norm(links - start, axis=1) / np.linalg.norm(start, axis=1)
        still = (step < STILL) & self._consistent
        # Links that hardly moved are restored; if that is infeasible, all stay free.
        for kept in (still, np.zeros_like(still)):
            free = np.repeat(~kept, 10)
            s = np.where(free, raw, self.start)
            for _ in range(2):  # least-norm step onto the equalities, repeated for its rounding
                rest = equalities @ (s - self.start)
                s[free] -= np.linalg.lstsq(equalities[:, free], rest, rcond=1e-12)[0]
            if np.abs(equalities @ (s - self.start)).max() < 1e-12 and self._is_inside(s):
                return s
        return None

    def _change(self, s: Array) -> float:
        return float(np.linalg.norm(self._rows @ (s - self.start)))

    def _cone(self, bound: float | None) -> Array:
        """Least torque change (bound None), else the nearest s whose change is within the bound."""
        # Variables (s, t): min t with A (s, t) + slack = b, slack in the cones of Clarabel.
        size = self.start.size
        masses, rows = self._masses, self._rows
        zero, eye = np.zeros, np.eye(size)
        left = masses
        near = (rows, rows @ self.start) if bound is None else (eye, self.start)
        second = [(*near, -1.0, 0.0)]  # ‖G s − h‖ ≤ t, then ≤ 1
        if bound == 0.0:  # a cone of radius zero has no interior: equalities instead
            left = np.vstack([masses, rows])
        elif bound is not None:
            second.append((rows / bound, rows @ self.start / bound, 0.0, 1.0))
        a = [np.hstack([left, zero((len(left), 1))])]
        b = [left @ self.start]
        cones: list[object] = [clarabel.ZeroConeT(len(left))]
        for matrix, target, t, head in second:
            parts = [np.append(zero(size), t), np.hstack([-matrix, zero((len(matrix), 1))])]
            a.append(np.vstack(parts))
            b.append(np.concatenate([[head], -target]))
            cones.append(clarabel.SecondOrderConeT(len(matrix) + 1))
        # s − ε s_ref ⪰ 0 per link, in svec.
        a.append(np.hstack([-eye, zero((size, 1))]))
        b.append(-self._least)
        cones += [clarabel.PSDTriangleConeT(4)] * (size // 10)
        cost = np.append(zero(size), 1.0)
        return _solve(cost, np.vstack(a), np.concatenate(b), cones)[:size]

    def _is_inside(self, s: Array) -> bool:
        """True if P ⪰ ½ ε P_ref: the step onto the equalities used at most half of the floor."""
        rest = (s - self._least / 2).reshape(-1, 10)
        return all(float(np.linalg.eigvalsh(_matrix(row))[0]) >= 0 for row in rest)


def _solve(cost: Array, a: Array, b: Array, cones: list[object]) -> Array:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    quadratic = sparse.csc_matrix((cost.size, cost.size))
    solver = clarabel.DefaultSolver(quadratic, cost, sparse.csc_matrix(a), b, cones, settings)
    solution = solver.solve()
    status = str(solution.status)
    if status not in {"Solved", "AlmostSolved"}:
        raise InertiaError(
            f"the projection was not solved (Clarabel status {status}); first correct inertials "
            "that are wrong by orders of magnitude"
        )
    return np.array(solution.x)


def _nearest(body: Body, floor: float) -> Array:
    return np.asarray(ca.DM(inertia.nearest_realisable(ca.DM(body.pi), floor))).ravel()


def _whitened(root: Any, pseudo: Array) -> Array:
    matrix = np.linalg.solve(root, np.linalg.solve(root, pseudo).T)
    return np.array([matrix[i, j] for i, j in _SVEC]) * _WEIGHT


def _matrix(svec: Array) -> Array:
    matrix = np.zeros((4, 4))
    for (i, j), value in zip(_SVEC, svec / _WEIGHT, strict=True):
        matrix[i, j] = matrix[j, i] = value
    return matrix
