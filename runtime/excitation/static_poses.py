"""Poses at rest that determine the gravity parameters of a robot, and their files.

    g(q) = Y_g(q) β_g,   Y_g(q) = Y_b(q, 0, 0) columns

β_g are those base parameters whose columns are independent at rest, chosen by QR with column
pivoting over random poses. A pivot that rounding alone explains ends the choice: the columns of
exact functions of q are either independent by far or not at all.

A pose q is reached from q − s and from q + s, all joints at once. Coulomb friction has opposite
signs after the two approaches, so that it cancels in the mean of both torques. A torque of noise
σ_j is read once after each; the mean has σ_j/√2, and the covariance of β_g is
(2 Σ_k Y_gᵀ diag(σ⁻²) Y_g)⁻¹.

K of many feasible candidates are chosen by exchange, min tr (Σ_k Y_kᵀ Y_k)⁻¹: one pose after
another is replaced by the candidate that lowers the trace most, until no exchange lowers it. The
result is a local optimum; several random starts are made.
Source: Fedorov, Theory of Optimal Experiments, 1972, ch. 3.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from runtime.common.files import json_text
from runtime.errors import IdentificationError
from runtime.excitation.limits.constraints import DEFAULT_RANGE, constraints
from runtime.excitation.limits.safety import Safety, require_share
from runtime.library import Array, Indices, Library

SIDES = {"below": -1.0, "above": 1.0}  # side of the approach to a pose → sign of its start
ROUNDING = 1e-10  # pivot over the largest that is zero: 1e-16 of rounding times a condition of 1e6
APPROACH = 0.05  # longest approach of a joint [rad, m]: beyond the backlash of usual gears
APPROACH_SHARE = 0.02  # longest approach as a share of the joint's range
ATTEMPTS = 200_000  # number of random poses that are tried before the robot counts as blocked
_CHUNK = 4096
_WAY = (-1.0, -0.5, 0.0, 0.5, 1.0)  # checked points of the approach, in units of s
RIDGE = 1e-9  # information added to each unknown, over the mean: sets without it compare
GAIN = 1e-6  # relative decrease of the trace below which an exchange does not count
SWEEPS = 30  # largest number of sweeps over all poses; usually six are enough
CANDIDATES = 1000  # number of feasible poses among which the design chooses
RANDOM_SETS = 50  # number of random sets of as many poses, to which the design is compared
MOST_POSES = 500  # largest number of poses; a person or a servo arm needs hours for as many
VISITS = 2


@dataclass(frozen=True, slots=True)
class PoseDesign:
    """Poses at rest and their accuracy."""

    poses: Array  # (K, n) rad or m
    approach: Array  # (n,) distance s from which every joint arrives, from below and from above
    columns: tuple[int, ...]  # indices of the gravity parameters among the base parameters
    sigma: float  # RMS standard deviation of the gravity parameters [kg·m]
    sigma_random: float  # mean of the same over random sets
    torque: float  # RMS standard deviation of the gravity torque over feasible poses [N·m]
    torque_random: float  # mean of the same over random sets
    assumptions: tuple[str, ...]  # sentences on limits that the robot does not state


def design_poses(
    lib: Library,
    count: int,
    safety: Safety,
    noise: Array,
    margin: float = 1.0,
    starts: int = 5,
    seed: int = 0,
) -> PoseDesign:
    """Choose poses for A-optimal gravity parameters."""
    if not 1 <= count <= MOST_POSES or starts < 1:
        raise IdentificationError(
            f"expected 1 to {MOST_POSES} poses and at least one start, got {count} and {starts}; "
            "12 poses are usual"
        )
    rng = np.random.default_rng(seed)
    where = pose_range(lib, margin)
    q = feasible_poses(lib, max(CANDIDATES, 2 * count), safety, where, rng)
    columns = gravity_columns(lib, q)
    y = gravity_regressor(lib, q, columns)
    scaled = np.sqrt(VISITS) * y / noise[:, None]
    grams = np.swapaxes(scaled, 1, 2) @ scaled
    least = -(-len(columns) // int(np.linalg.matrix_rank(grams).max()))
    if count < least:
        raise IdentificationError(
            f"expected at least {least} poses for the {len(columns)} gravity parameters of "
            f"'{lib.name}', got {count}; give --settings poses={2 * least} or more"
        )
    chosen, _ = a_optimal(grams, count, starts, rng)
    mean = (np.swapaxes(y, 1, 2) @ y).mean(axis=0) / lib.n_joints
    sigma, torque = _accuracy(grams[chosen].sum(axis=0), mean)
    sets = [rng.choice(len(q), count, replace=False) for _ in range(RANDOM_SETS)]
    of_sets = np.mean([_accuracy(grams[each].sum(axis=0), mean) for each in sets], axis=0)
    return PoseDesign(
        q[chosen],
        where.approach,
        tuple(columns.tolist()),
        sigma,
        float(of_sets[0]),
        torque,
        float(of_sets[1]),
        where.assumptions,
    )


def _accuracy(gram: Array, mean: Array) -> tuple[float, float]:
    """RMS σ of the parameters, and RMS σ of the torque at poses with mean YᵀY per joint."""
    covariance = np.linalg.pinv(gram, hermitian=True)
    if np.linalg.matrix_rank(gram, hermitian=True) < len(gram):
        return np.inf, np.inf
    parameters = float(np.sqrt(np.trace(covariance) / len(gram)))
    return parameters, float(np.sqrt(np.sum(mean * covariance)))


@dataclass(frozen=True, slots=True)
class PoseRange:
    """Range of the joints at rest and length of the approach."""

    lower: Array  # lower, upper: ends of the poses, (n,) rad or m; limits for the approach too
    upper: Array
    approach: Array  # s, (n,) rad or m
    assumptions: tuple[str, ...]  # ranges that the robot does not state, as sentences


def pose_range(lib: Library, margin: float = 1.0) -> PoseRange:
    """Range of the poses: position limits shrunk by margin and approach."""
    require_share(margin, "a margin", "the range unused")
    limits = lib.limits()
    lower = np.where(np.isfinite(limits["lower"]), limits["lower"], lib.home - DEFAULT_RANGE)
    upper = np.where(np.isfinite(limits["upper"]), limits["upper"], lib.home + DEFAULT_RANGE)
    unknown = ~(np.isfinite(limits["lower"]) & np.isfinite(limits["upper"]))
    names = ", ".join(np.array(lib.joint_names)[unknown])
    sentence = f"no position limits for {names}: {DEFAULT_RANGE:.4g} about home assumed"
    assumptions = (sentence,) if unknown.any() else ()
    middle, half = (upper + lower) / 2, margin * (upper - lower) / 2
    approach = np.minimum(APPROACH, APPROACH_SHARE * 2 * half)
    return PoseRange(middle - half + approach, middle + half - approach, approach, assumptions)


def feasible_poses(
    lib: Library, count: int, safety: Safety, where: PoseRange, rng: np.random.Generator
) -> Array:
    """Random poses, uniform over the range, that keep every limit on both approaches."""
    limits = constraints(lib, lib.home, safety)
    n, kept, tried, total = lib.n_joints, [], 0, 0
    while total < count:
        if tried >= ATTEMPTS:
            raise IdentificationError(
                f"expected {count} poses within all limits, found {total} among {tried} random "
                "poses; lower --table, widen --box, or lower the setting clearance"
            )
        q = rng.uniform(where.lower, where.upper, (_CHUNK, n))
        way = (q[:, None] + np.array(_WAY)[:, None] * where.approach).reshape(-1, n)
        motion = np.zeros((4, len(way), n))
        motion[0] = way
        allowed = np.ones(len(way), dtype=bool)
        for limit in limits:
            # A value that is not a number counts as a broken limit.
            allowed &= (limit.values(motion) <= 0).all(axis=1)
        kept.append(q[allowed.reshape(_CHUNK, len(_WAY)).all(axis=1)])
        tried, total = tried + _CHUNK, total + len(kept[-1])
    return np.concatenate(kept)[:count]


def gravity_columns(lib: Library, q: Array) -> Indices:
    """Indices of the base parameters that gravity determines at poses (N, n)."""
    rest = np.zeros_like(q)
    stacked = lib.base_regressor(q, rest, rest).reshape(q.size, -1)
    triangle, pivots = qr(stacked, mode="economic", pivoting=True)[1:]
    size = np.abs(np.diag(triangle))
    if not size.size or size[0] < ROUNDING:
        raise IdentificationError(
            f"gravity causes no torque on any joint of '{lib.name}', so poses at rest determine no "
            "parameter; design a motion instead: python -m runtime excite without --settings "
            "static=true"
        )
    rank = int((size > ROUNDING * size[0]).sum())
    return np.sort(pivots[:rank])


def gravity_regressor(lib: Library, q: Array, columns: Indices) -> Array:
    """Regressor Y_g of the torques at rest, (N, n, r) [N·m per unit of the parameters]."""
    rest = np.zeros_like(q)
    return lib.base_regressor(q, rest, rest)[..., columns]


def a_optimal(
    grams: Array, count: int, starts: int, rng: np.random.Generator
) -> tuple[Indices, float]:
    """Choose candidates (K,) with the least trace of the inverse of Σ grams (C, r, r)."""
    ridge = RIDGE * float(np.trace(grams.mean(axis=0))) / grams.shape[-1]
    best, least = np.arange(count), np.inf
    for _ in range(starts):
        chosen = rng.choice(len(grams), count, replace=False)
        value = _exchanged(grams, chosen, ridge)
        if value < least:
            best, least = chosen, value
    return best, least


def trace_of(grams: Array, ridge: float) -> Array:
    """Trace of the inverse information."""
    inverse = np.linalg.inv(grams + ridge * np.eye(grams.shape[-1]))
    return np.asarray(np.trace(inverse, axis1=-2, axis2=-1))


def _exchanged(grams: Array, chosen: Indices, ridge: float) -> float:
    """Exchange in place until no exchange lowers the trace; the trace."""
    value = float(trace_of(grams[chosen].sum(axis=0), ridge))
    for _ in range(SWEEPS):
        before = value
        for place in range(len(chosen)):
            others = grams[np.delete(chosen, place)].sum(axis=0)
            values = trace_of(others + grams, ridge)
            values[np.delete(chosen, place)] = np.inf  # a pose is visited once
            other = int(np.argmin(values))
            if values[other] < value * (1 - GAIN):
                chosen[place], value = other, float(values[other])
        if value > before * (1 - GAIN):
            break
    return value


def pose_json(designed: PoseDesign, lib: Library) -> bytes:
    """JSON document of the poses."""
    names = lib.joint_names
    facts = {
        "robot": lib.name,
        "joints": list(names),
        "poses": designed.poses.tolist(),
        "approach": dict(zip(names, designed.approach.tolist(), strict=True)),
        "gravity_parameters": len(designed.columns),
        "sigma_parameters": designed.sigma,
        "sigma_parameters_random": _finite(designed.sigma_random),
        "sigma_torque": designed.torque,
        "sigma_torque_random": _finite(designed.torque_random),
        "assumptions": list(designed.assumptions),
    }
    return json_text(facts).encode()


def pose_table(designed: PoseDesign, lib: Library) -> bytes:
    """CSV with two rows per pose: from below and from above.

    Columns: pose (from 0), side, the start of the approach per joint, the pose per joint [rad, m].
    """
    names = lib.joint_names
    lines = [",".join(["pose", "side", *(f"{name}_start" for name in names), *names])]
    for k, q in enumerate(designed.poses):
        for side, sign in SIDES.items():
            numbers = np.concatenate([q + sign * designed.approach, q])
            lines.append(",".join([str(k), side, *(f"{value:.9g}" for value in numbers)]))
    return ("\n".join(lines) + "\n").encode()


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
