"""Limits of a motion: those of joints, linear in its coefficients, and all others as constraints.

Limits of position, velocity and acceleration are linear in a. The others, from `Safety` and
manifest, are g(a) ≤ 0 at the samples of a grid, with Jacobian rows on demand. Every derivative of
the motion is linear in a: ∂g/∂a_jm = Σ_d ∂g/∂q_j^(d) φ_m^(d)(t).
"""

from collections.abc import Iterator, Sequence

import numpy as np

from runtime.errors import IdentificationError
from runtime.excitation.limits.distance_limits import (
    LABEL,
    OBSTACLE,
    BoxClearance,
    CarriedHeight,
    LinkClearance,
    TableClearance,
    TipBox,
    TipSpeed,
    capsule_around,
)
from runtime.excitation.limits.nonlinear_limits import (
    Braking,
    Constraint,
    DependentLimit,
    Side,
    TimedConstraint,
    dependent_joints,
)
from runtime.excitation.limits.safety import Safety, with_load
from runtime.excitation.limits.torque_limits import ModelBand, TorqueLimit, known_torque_of
from runtime.excitation.motion.family import Basis
from runtime.excitation.motion.trajectory import COSINE
from runtime.library import Array, Indices, Library
from runtime.library.manifest import torque_units

LIMIT_STEP = 0.1  # grid of limits in the descent, s (Sec. 3.4.2); the check is at 1 kHz
DEFAULT_ACCELERATION = 10.0  # acceleration limit where the robot states none, rad/s² or m/s²
DEFAULT_RANGE = np.pi  # range on both sides of home of a joint without position limits, rad or m
NEAR = -0.35  # rows above this value are linearised; what lies lower stays below 0 within a step
TABLE_MARGIN = 0.03  # margin between every moving proxy and the table or an obstacle, m
CARRIED_MARGIN = 0.02  # margin between a carried box and links of a robot that states no margins, m
FIT_PROXIES = (
    "fit them with: python -m symgen proxies URDF --out X.toml, and build with --config X.toml"
)
_PROBES = 32  # number of random poses; between them every proxy that can move has moved
AT_LIMIT = 1e-9  # largest g of a robot at rest on a limit: rounding, 1e-10 m of places
_FRICTION = ("viscous", "coulomb")


def constraints(
    lib: Library, home: Array, safety: Safety | None
) -> tuple[Braking | TimedConstraint, ...]:
    """Limits that are not linear in the coefficients."""
    chosen: list[Braking | TimedConstraint] = [*dependent_joints(lib, home)]
    if safety is None:
        return tuple(chosen)
    if (facts := lib.braking) is not None:
        ends = (1.0, facts.upper), (-1.0, facts.lower)
        sides = tuple(Side(sign, facts.k, facts.c, end) for sign, end in ends)
        chosen.append(Braking(sides, home, lib.joint_names))
    return (*chosen, *_torques(lib, safety), *_tip(lib, safety), *distances(lib, safety))


def _torques(lib: Library, safety: Safety) -> Iterator[TimedConstraint]:
    limits, n = lib.limits(), lib.n_joints
    viscous, coulomb = (_per_joint(lib, name, getattr(safety, name)) for name in _FRICTION)
    coulomb = (1 + safety.friction_band) * coulomb
    pi, band = with_load(lib.pi0, safety.carried), _band(lib, safety, viscous)
    rest = viscous, lib.joint_names, band, known_torque_of(lib)
    if np.isfinite(limits["effort"]).any():
        limit = safety.torque_fraction * limits["effort"] - coulomb
        if not (limit > 0).all():
            j = int(np.argmin(limit))
            unit = torque_units(lib.manifest)[j]
            raise IdentificationError(
                f"Coulomb friction of {coulomb[j]:g} {unit} exceeds the torque of "
                f"'{lib.joint_names[j]}', {100 * safety.torque_fraction:g} % of "
                f"{limits['effort'][j]:g} {unit}; lower the friction or raise the share"
            )
        yield TorqueLimit(0, lib, pi, limit, *rest)
    if np.isfinite(limits["torque_rate"]).any():
        yield TorqueLimit(1, lib, pi, np.broadcast_to(limits["torque_rate"], (n,)), *rest)


def _band(lib: Library, safety: Safety, viscous: Array) -> ModelBand | None:
    if not (safety.band or safety.friction_band):
        return None
    pi = np.array(safety.band or np.zeros(len(lib.pi0)))
    if pi.shape != lib.pi0.shape:
        raise IdentificationError(
            f"a band of models of '{lib.name}' needs {len(lib.pi0)} half-widths, got {len(pi)}"
        )
    return ModelBand(lib, pi, safety.friction_band * viscous)


def _per_joint(lib: Library, name: str, values: tuple[float, ...]) -> Array:
    if len(values) not in {0, 1, lib.n_joints}:
        raise IdentificationError(
            f"{name} friction needs one number or one per joint, {lib.n_joints}, got {len(values)}"
        )
    return np.broadcast_to(np.array(values or (0.0,), dtype=float), (lib.n_joints,)).copy()


def _tip(lib: Library, safety: Safety) -> Iterator[TimedConstraint]:
    if safety.box is not None:
        ends = np.array(safety.box, dtype=float)
        yield TipBox(lib, ends[::2], ends[1::2])
    speed = float(lib.limits()["tip_speed"])
    if np.isfinite(speed):
        yield TipSpeed(lib, speed)


def require_rest(limits: tuple[Constraint, ...], home: Array) -> None:
    """Check that the robot may rest at home."""
    rest = np.zeros((4, 1, len(home)))
    rest[0] = home
    for constraint in limits:
        g = constraint.values(rest)[0]
        worst = int(np.argmax(g))  # the first NaN, where there is one
        if g[worst] < 0:
            continue
        if isinstance(constraint, Braking):
            side, joint = constraint.sides[worst // len(home)], worst % len(home)
            raise IdentificationError(
                f"at the home position {home[joint]:.4g} of '{constraint.labels[worst]}' its "
                f"velocity limit, which ends at {side.end[joint]:.4g}, leaves no speed; choose "
                "another home"
            )
        value, limit, unit = constraint.measured(worst, float(g[worst]))
        if g[worst] <= AT_LIMIT:
            raise IdentificationError(
                f"at rest at home the {constraint.kind} limit of {constraint.labels[worst]}, "
                f"{limit:.4g} {unit}, is already reached and leaves no room for a motion; choose "
                "another home or limit"
            )
        raise IdentificationError(
            f"at rest at home the {constraint.kind} limit of {constraint.labels[worst]} is already "
            f"broken: {value:.4g} {unit} where {limit:.4g} {unit} is allowed, "
            f"{abs(value - limit):.3g} {unit} too far; choose another home or limit"
        )


def distances(lib: Library, safety: Safety) -> tuple[TimedConstraint, ...]:
    """Constraints on distances."""
    if safety.clearance is not None and not lib.pairs:
        raise _no_proxies(lib, "a clearance between its links")
    if safety.table is not None and not lib.moving_proxies:
        raise _no_proxies(lib, "a table")
    chosen: list[TimedConstraint] = []
    if lib.pairs:
        names = tuple(f"{pair.first} and {pair.second}" for pair in lib.pairs)
        chosen.append(LinkClearance(lib, _margins(lib, safety.clearance), names))
    if safety.table is not None:
        margin = TABLE_MARGIN if safety.clearance is None else safety.clearance
        rows = _lifted(lib)
        proxies = tuple(lib.moving_proxies[row] for row in rows)
        chosen.append(TableClearance(lib, safety.table, margin, proxies, rows))
    return (*chosen, *_obstacle_distances(lib, safety), *_carried_distances(lib, safety))


def _obstacle_distances(lib: Library, safety: Safety) -> tuple[TimedConstraint, ...]:
    """Distances of the moving capsules and of the carried box from obstacles."""
    if not safety.obstacles:
        return ()
    proxies = [proxy for proxy in lib.proxies if proxy.joint >= 0]
    if not proxies:
        raise _no_proxies(lib, "the distance from obstacles")
    body = safety.carried
    if body is not None and body.box is not None:
        proxies.append(capsule_around(body.box.placed(body.link)))
    margin = TABLE_MARGIN if safety.clearance is None else safety.clearance
    labels = (f"{p.name} and {each.name}" for each in safety.obstacles for p in proxies)
    boxes = tuple(each.placed for each in safety.obstacles)
    return (BoxClearance(OBSTACLE, tuple(labels), lib, margin, boxes, tuple(proxies)),)


def _carried_distances(lib: Library, safety: Safety) -> Iterator[TimedConstraint]:
    """Distances of the carried box from links that it is not fixed to, and from the table."""
    body = safety.carried
    if body is None or body.box is None:
        return
    box = body.box.placed(body.link)
    others = tuple(proxy for proxy in lib.proxies if proxy.joint != body.link)
    if others:
        stated = max((pair.margin for pair in lib.pairs), default=CARRIED_MARGIN)
        margin = stated if safety.clearance is None else safety.clearance
        labels = tuple(f"{LABEL} and {proxy.name}" for proxy in others)
        yield BoxClearance("self-collision", labels, lib, margin, (box,), others)
    if safety.table is not None:
        margin = TABLE_MARGIN if safety.clearance is None else safety.clearance
        yield CarriedHeight(lib, margin, box, safety.table)


def _margins(lib: Library, clearance: float | None) -> Array:
    """Margin of every pair, (R,) m; pairs that are allowed closer than the others stay so."""
    stated = np.array([pair.margin for pair in lib.pairs])
    if clearance is None:
        return stated
    return np.where(stated < stated.max(), np.minimum(stated, clearance), clearance)


def _lifted(lib: Library) -> Indices:
    """Indices of proxies whose height depends on some joint; the height of the others is fixed."""
    q = np.random.default_rng(0).uniform(-1, 1, (_PROBES, lib.n_joints))
    heights = lib.plane_clearance(q, np.array([0.0, 0.0, 1.0, 0.0]))[0]
    # A pose is known to rounding, 1e-15 of a metre.
    return np.flatnonzero(np.ptp(heights, axis=0) > 1e-9)


def _no_proxies(lib: Library, what: str) -> IdentificationError:
    return IdentificationError(
        f"'{lib.name}' has no collision proxies, so {what} cannot be checked; {FIT_PROXIES}"
    )


class Limits:
    """Position, velocity and acceleration limits, linear in the coefficients."""

    def __init__(
        self,
        lib: Library,
        home: Array,
        harmonics: int,
        duration: float,
        step: float = LIMIT_STEP,
        basis: Basis = COSINE,
        share: float = 1.0,
    ) -> None:
        """Limits on a grid."""
        limits = lib.limits()
        self.assumptions: list[str] = []
        low, high = (f"{DEFAULT_RANGE:.4g} {side} home" for side in ("below", "above"))
        lower = self._or(limits["lower"], home - DEFAULT_RANGE, "lower position", lib, low)
        upper = self._or(limits["upper"], home + DEFAULT_RANGE, "upper position", lib, high)
        speed = self._or(limits["velocity"], np.pi, "velocity", lib)
        accel = self._or(limits["acceleration"], DEFAULT_ACCELERATION, "acceleration", lib)
        outside = (home <= lower) | (home >= upper)
        if outside.any():
            j = int(np.argmax(outside))
            raise IdentificationError(
                f"the home position {home[j]:.4g} of joint '{lib.joint_names[j]}' is not inside "
                f"its limits {lower[j]:.4g} to {upper[j]:.4g}; choose another home"
            )
        end = duration / 2 if basis.is_symmetric else duration
        t = np.linspace(0, end, int(np.ceil(end / step)) + 1)
        phi = basis.at(lib, harmonics, t, duration)
        self._kinds = {
            "position": (phi[..., 0], share * (upper - home), share * (home - lower)),
            "velocity": (phi[..., 1], share * speed, share * speed),
            "acceleration": (phi[..., 2], share * accel, share * accel),
        }

    def _or(
        self, values: Array, missing: float | Array, what: str, lib: Library, described: str = ""
    ) -> Array:
        unknown = ~np.isfinite(values)
        if unknown.any():
            names = ", ".join(np.array(lib.joint_names)[unknown])
            text = described or f"{missing:.4g}"
            self.assumptions.append(f"no {what} limit for {names}: {text} assumed")
        return np.where(unknown, missing, values)

    def use(self, a: Array) -> dict[str, Array]:
        """Largest |value| over the share of the limit, per joint (n,), for each kind of limit."""
        shares = {}
        for kind, (rows, up, down) in self._kinds.items():
            values = rows @ a.T
            shares[kind] = np.maximum((values / up).max(0), (-values / down).max(0))
        return shares

    def inequalities(self) -> tuple[Array, Array]:
        """All limits as A vec(a) ≤ b: A (rows, n M) and b of ones."""
        blocks = []
        for rows, up, down in self._kinds.values():
            for bound, signed in ((up, rows), (down, -rows)):
                for j, limit in enumerate(bound):
                    block = np.zeros((len(rows), len(bound), rows.shape[1]))
                    block[:, j] = signed / limit
                    blocks.append(block.reshape(len(rows), -1))
        matrix = np.vstack(blocks)
        matrix = matrix[np.abs(matrix).max(axis=1) > 0]
        return matrix, np.ones(len(matrix))


def whitening(matrix: Array, n: int) -> Array:
    """Linear change of coordinates (n M, n M) in which the limits look alike in all directions.

    With a = S x, S Sᵀ is, joint by joint, the inverse Hessian of −Σ ln(1 − A a) at rest. The raw
    coefficients differ in scale by three orders of magnitude, which slows a quasi-Newton method.
    """
    width = matrix.shape[1] // n
    result = np.zeros((matrix.shape[1], matrix.shape[1]))
    for j in range(n):
        part = slice(j * width, (j + 1) * width)
        try:
            lower = np.linalg.cholesky(matrix[:, part].T @ matrix[:, part])
        except np.linalg.LinAlgError:
            # Between samples such functions move without any limit.
            raise IdentificationError(
                f"the limits are sampled every {LIMIT_STEP:g} s, too seldom for {width} functions "
                "per joint in this duration; lower the setting harmonics or raise --duration"
            ) from None
        result[part, part] = np.linalg.inv(lower).T
    return result


def inside(limits: Limits, a: Array) -> Array:
    """Scale the coefficients (n, M) of each joint back until no limit is exceeded."""
    rho = np.maximum(1.0, np.max(list(limits.use(a).values()), axis=0))
    return a / rho[:, None]


def spared(constraint: Constraint, share: float) -> float:
    """Amount by which g is raised so that g ≤ 0 leaves a share of the limit unused."""
    if isinstance(constraint, TipSpeed):
        return (1 - share**2) / 2
    uses = Braking | TorqueLimit | DependentLimit
    return 1 - share if isinstance(constraint, uses) else 0.0


def unit_of(constraint: Constraint, share: float) -> float:
    """Part of the limit that is the unit of g, so that g is use − 1 of the share.

    Coefficients at the bounds are as small as the share. In units of the whole limit a motion far
    beyond the share of another one has a small g, and a penalty that outweighs the cost for whole
    limits does not outweigh it.
    """
    return share**2 if isinstance(constraint, TipSpeed) else share


class LimitRows:
    """Values g(a) of constraints on a grid, (R, N) each; of a share (use − share) / share."""

    def __init__(
        self,
        constraints: Sequence[Constraint],
        home: Array,
        basis: Array,
        half: bool,
        tightened: float = 0.0,
        share: float = 1.0,
    ) -> None:
        """Rows of constraints on a grid."""
        self._constraints, self._home, self._basis = tuple(constraints), home, basis
        self._tightened = tightened
        self._spared = [spared(each, share) for each in self._constraints]
        self._units = [unit_of(each, share) for each in self._constraints]
        middle = (len(basis) + 1) // 2
        # The merit comes first and the rows of the same point after it: values are computed once.
        self._seen: tuple[Array, list[Array]] = np.zeros(0), []
        self._counts = [
            middle if half and constraint.even else len(basis) for constraint in self._constraints
        ]

    def motion(self, a: Array) -> Array:
        """Values q, dq, ddq, dddq on the grid, (4, N, n)."""
        motion = np.tensordot(self._basis, a, axes=(1, 1)).transpose(1, 0, 2)
        motion[0] += self._home
        return motion

    def by_constraint(self, a: Array) -> list[Array]:
        """Values g per constraint, (R, N) each."""
        if not self._constraints:  # a long grid of the motion takes a gigabyte for nothing
            return []
        if not np.array_equal(self._seen[0], a):
            motion = self.motion(a)
            parts = [
                (constraint.values(motion[:, :count]).T + more) / unit + self._tightened
                for constraint, count, more, unit in zip(
                    self._constraints, self._counts, self._spared, self._units, strict=True
                )
            ]
            self._seen = a.copy(), parts
        return list(self._seen[1])

    def values(self, a: Array) -> Array:
        """All values g, one constraint after another."""
        parts = [values.ravel() for values in self.by_constraint(a)]
        return np.concatenate(parts) if parts else np.zeros(0)

    def worst(self, a: Array) -> float:
        """Largest g; −1 where there are no constraints."""
        return float(self.values(a).max(initial=-1.0))

    def linearised(self, a: Array, near: float = NEAR) -> tuple[Indices, Array, Array]:
        """Rows that a step could violate: numbers (m,), values and slopes."""
        values = self.values(a)
        chosen = np.flatnonzero(values > near)
        return chosen, values[chosen], self.jacobian(a, chosen)

    def jacobian(self, a: Array, chosen: Indices) -> Array:
        """Slopes ∂g/∂vec(a), (m, n M), of chosen rows (m,)."""
        motion = self.motion(a)
        blocks, first = [np.zeros((0, a.size))], 0
        for constraint, count, unit in zip(
            self._constraints, self._counts, self._units, strict=True
        ):
            last = first + count * len(constraint.labels)
            row, sample = np.divmod(chosen[(chosen >= first) & (chosen < last)] - first, count)
            first = last
            if not row.size:
                continue
            samples, back = np.unique(sample, return_inverse=True)
            slopes = constraint.slopes(motion[:, samples])[back, row] / unit  # (rows, orders, n)
            # Chain rule over the derivatives of the motion: Σ_d ∂g/∂q^(d) φ^(d), (rows, M, n).
            chain = np.matmul(self._basis[sample][:, :, : constraint.orders], slopes)
            blocks.append(chain.transpose(0, 2, 1).reshape(len(row), -1))
        return np.concatenate(blocks)

    def strongest(self, a: Array, count: int = 2) -> list[str]:
        """Names of the rows with the largest g, each of another constraint or joint."""
        named = [
            (float(g), f"{constraint.kind} ({label})")
            for constraint, values in zip(self._constraints, self.by_constraint(a), strict=True)
            for label, g in zip(constraint.labels, values.max(axis=1), strict=True)
        ]
        return [name for _, name in sorted(named, reverse=True)[:count]]
