"""Certificates of random motions against Pinocchio and coal, and violations between samples.

The motion is that of its basis; torques, tip and distances are those of the two engines. Torques
and tip are taken at 20 kHz, distances at 1 kHz and at 20 kHz around their smallest values; the
largest values are then moved to the nearest local maximum.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio
from scipy.optimize import minimize_scalar

from runtime import load
from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import Limits, constraints, inside
from runtime.excitation.limits.distance_limits import Clearance
from runtime.excitation.limits.safety import Safety
from runtime.excitation.limits.torque_limits import TorqueLimit
from runtime.excitation.motion.trajectory import basis_of
from runtime.excitation.proof.bounds import constraint_bounds
from runtime.excitation.proof.certificate import Certificate, certificate_of
from runtime.library import Array, Library
from symgen.chain import read_chain
from symgen.collision.model import BASE, Pair, Proxy
from symgen.make.config import RobotConfig
from symgen.make.pipeline import build
from symgen.make.request import BuildRequest
from tests.collision_oracle import capsule_of, pair_distances
from tests.oracle import pinocchio_model
from tests.robots import CASES
from tests.runtime.excitation.proof.spiked import Spiked

ROBOTS = ("fr3", "ur5e", "xarm7", "gantry")
TABLE = -0.2  # height of the table, m
DENSE, COARSE = 20_000, 1000  # rates of the check, Hz
_RADIUS = 0.04  # of capsules along the links of robots without proxies, m
_SHRUNK = 0.7  # factor of a motion that does not hold
_GJK = 2e-6  # Coal's GJK ends at 1e-6 m
_SECANTS = 6
"""Steps to the height of a bump that dips by half a millimetre; closest points move with it."""
BUMP = 0.3e-3  # duration of a planted bump, s


def robot(name: str, models: Path, root: Path) -> Library:
    """A bundled robot, or one that is built with capsules along its links and further limits."""
    if name in {"fr3", "ur5e"}:
        return load(name)
    request = CASES[name].request(name, models)
    chain = read_chain(request.urdf, request.options)
    n = len(chain.joints)
    origin = (0.0, 0.0, 0.0)
    ends = [joint.translation for joint in chain.joints[1:]] + [chain.tip.translation]
    links = [BASE, *(joint.link for joint in chain.joints)]
    ends = [chain.joints[0].translation, *ends]
    proxies = tuple(
        Proxy(f"part{i}", link, origin, tuple(end), _RADIUS)
        for i, (link, end) in enumerate(zip(links, ends, strict=True))
    )
    pairs = tuple(
        Pair(f"part{i}", f"part{j}", -1.0) for i in range(n + 1) for j in range(i + 2, n + 1)
    )
    config = RobotConfig(torque_rate=(1000.0,) * n, tip_speed=2.0, proxy=proxies, pair=pairs)
    made: BuildRequest = replace(request, config=config)
    return load(build(made, root, levels=(load("fr3").level,)).folder)


class Engines:
    """Pinocchio's model of a robot, with the capsules of its links in coal."""

    def __init__(self, lib: Library) -> None:
        self.lib, self.model = lib, pinocchio_model(lib.urdf(), lib.gravity)
        self._data = self.model.createData()
        self._tip = self.model.getFrameId(lib.manifest.tip, pinocchio.BODY)
        self._placed = {p.name: (p.joint + 1, *capsule_of(p)) for p in lib.proxies}

    def torques(self, states: Array) -> Array:
        """Torques of states (3 or more, N, n), (N, n)."""
        rows = zip(*states[:3], strict=True)
        return np.array([pinocchio.rnea(self.model, self._data, *row) for row in rows])

    def tip_speeds(self, states: Array) -> Array:
        """Speeds of the tip, (N,) m/s."""
        speeds = []
        for q, dq in zip(*states[:2], strict=True):
            pinocchio.forwardKinematics(self.model, self._data, q, dq)
            v = pinocchio.getFrameVelocity(self.model, self._data, self._tip)
            speeds.append(np.linalg.norm(v.linear))
        return np.array(speeds)

    def distances(self, states: Array, pairs: list[tuple[str, str]]) -> Array:
        """Distance of every pair, (N, R) m; the second of a pair may be "table"."""
        return np.array(list(pair_distances(self.model, self._placed, TABLE, states[0], pairs)))


@dataclass(frozen=True, slots=True)
class Checked:
    """One motion: largest excess over a proven bound, and error of the margins."""

    robot: str
    basis: str  # of the motion
    excess: float  # largest true use less the bound
    where: str  # limit of that excess
    torque_share: float  # margin of the proof over the true one, of the torque
    distance_gap: float  # largest true distance less the stated one, m


def certified_motion(
    lib: Library, rng: np.random.Generator
) -> tuple[Trajectory, Safety, Certificate]:
    """A random motion of 1 to 3 s that holds all limits, as large as that allows."""
    n = lib.n_joints
    basis = basis_of(str(rng.choice(["cosine", "fourier", "bspline"])))
    size, duration = basis.size(int(rng.integers(2, 7))), float(rng.uniform(1.0, 3.0))
    safety = Safety(table=TABLE, viscous=tuple(rng.uniform(0, 2, n)))
    a = inside(Limits(lib, lib.home, size, duration, basis=basis), rng.normal(size=(n, size)))
    while True:
        motion = Trajectory(lib.home, a, duration, basis)
        proof = certificate_of(lib, motion, safety)
        if proof.holds:
            return motion, safety, proof
        a = _SHRUNK * a


def states_of(motion: Trajectory, t: Array) -> Array:
    """q, dq, ddq, dddq at times (N,), (4, N, n)."""
    a = motion.coefficients
    s = np.clip(t / motion.duration, 0.0, 1.0)
    states = motion.basis.derivatives(4, a.shape[1], s) @ a.T
    states /= motion.duration ** np.arange(4.0)[:, None, None]
    states[0] += motion.home
    return states


def _peak(function: Callable[[Array], Array], motion: Trajectory, t: Array, values: Array) -> float:
    """Largest value near the largest sample, by bounded search."""
    k = int(np.argmax(values))
    step = t[1] - t[0]
    low, high = max(0.0, t[k] - step), min(motion.duration, t[k] + step)
    answer = minimize_scalar(
        lambda x: -float(function(states_of(motion, np.array([x])))[0]),
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return max(float(values[k]), -float(answer.fun))


def check(lib: Library, rng: np.random.Generator) -> Checked:
    """Compare one certificate with the engines."""
    motion, safety, proof = certified_motion(lib, rng)
    engines = Engines(lib)
    t = np.arange(int(motion.duration * DENSE) + 1) / DENSE
    states = states_of(motion, t)
    limits, viscous = lib.limits(), np.array(safety.viscous)
    most = safety.torque_fraction * limits["effort"]
    friction = viscous * states[1]
    tau = engines.torques(states)
    true = {}
    share = np.abs(tau + friction) / most
    joint = int(np.argmax(share.max(axis=0)))
    true["torque"] = _peak(
        lambda x: np.abs(engines.torques(x) + viscous * x[1])[:, joint] / most[joint],
        motion,
        t,
        share[:, joint],
    )
    # The mean rate between two samples; it is reached in between.
    rate = np.abs(np.diff(tau + friction, axis=0)) * DENSE / limits["torque_rate"]
    true["torque rate"] = float(rate.max())
    speed = engines.tip_speeds(states) / limits["tip_speed"]
    true["tip speed"] = _peak(
        lambda x: engines.tip_speeds(x) / limits["tip_speed"], motion, t, speed
    )
    excess, where = -np.inf, ""
    for use in proof.uses:
        if use.kind in true:
            # Rounding of torques of 100 N·m, and of their differences over 50 µs.
            over = true[use.kind] - use.bound - 1e-8
            excess, where = max((excess, where), (over, use.kind))
    gap = 0.0
    for over, text in _distances(engines, motion, proof):
        excess, where = max((excess, where), (over, text))
        gap = max(gap, -over)
    torque = next(use for use in proof.uses if use.kind == "torque")
    margin = torque.margin / (1 - true["torque"])
    return Checked(lib.name, motion.basis.name, excess, where, margin, gap)


def _distances(
    engines: Engines, motion: Trajectory, proof: Certificate
) -> Iterator[tuple[float, str]]:
    """Stated distance less the true one for every pair, m."""
    stated = {}
    for use in proof.distances:
        one, _, other = use.where.partition(" and ")
        stated[one, other or "table"] = use.value
    pairs = list(stated)
    t = np.arange(int(motion.duration * COARSE) + 1) / COARSE
    coarse = engines.distances(states_of(motion, t), pairs)
    for column, pair in enumerate(pairs):
        near = t[np.argmin(coarse[:, column])] + np.arange(-20, 21) / DENSE
        near = near[(near >= 0) & (near <= motion.duration)]

        def opposite(x: Array, pair: tuple[str, str] = pair) -> Array:
            return -engines.distances(x, [pair])[:, 0]

        smallest = -_peak(opposite, motion, near, opposite(states_of(motion, near)))
        yield stated[pair] - smallest - _GJK, f"{pair[0]} and {pair[1]}"


def proof_seconds(lib: Library, rng: np.random.Generator, count: int = 5) -> float:
    """Longest processor time of a certificate of motions of 20 s with all limits."""
    longest, sides = 0.0, (0.1, 0.9, -0.7, 0.7, 0.1, 1.1)
    safety = Safety(table=0.0, box=sides, viscous=(2.0,), coulomb=(1.0,))
    for name in ("cosine", "fourier", "bspline"):
        basis = basis_of(name)
        size = basis.size(8)
        for _ in range(count):
            a = rng.normal(size=(lib.n_joints, size))
            a = inside(Limits(lib, lib.home, size, 20.0, basis=basis), a)
            motion = Trajectory(lib.home, 0.6 * a, 20.0, basis)
            start = time.process_time()
            certificate_of(lib, motion, safety)
            longest = max(longest, time.process_time() - start)
    return longest


def planted(lib: Library, rng: np.random.Generator) -> tuple[bool, bool]:
    """Plant a spike of torque of 0.3 ms and a dip of a distance of 0.5 mm between two samples."""
    n, duration = lib.n_joints, 2.0
    # The first joint turns about the vertical, the last one about the axis of its link: neither
    # changes the distances.
    joint = int(rng.integers(1, n - 1))
    middle = (rng.integers(200, 1800) + 0.5) * 1e-3 / duration
    basis = Spiked(float(middle), BUMP / 2 / duration)
    calm = 1e-3 * rng.normal(size=(n, 4))
    limits = constraints(lib, lib.home, Safety(table=TABLE))
    torque = next(one for one in limits if isinstance(one, TorqueLimit) and one.order == 0)
    clearances = [one for one in limits if isinstance(one, Clearance)]
    t = np.arange(2001) * 1e-3
    inside_ = np.linspace(-BUMP / 2, BUMP / 2, 301) + middle * duration

    def motion(height: float) -> Trajectory:
        heights = height * (np.arange(n) == joint)
        return Trajectory(lib.home, np.column_stack([calm, heights]), duration, basis)

    # Torque: the acceleration −16 height / half² of the bump's top makes twice the effort limit.
    sign = float(rng.choice([-1, 1]))
    spike = motion(sign * torque.limit[joint] * (BUMP / 2) ** 2 / 16)
    seen, true = (torque.values(states_of(spike, x)).max(axis=0) for x in (t, inside_))
    row = int(np.argmax(true - seen))
    bound = constraint_bounds(lib, [torque], spike)[row].bound
    caught = bool(true[row] > seen[row] and bound > (seen[row] + true[row]) / 2)
    # Distance: the row that changes most, scaled so that it dips by half a millimetre.
    rest = states_of(motion(0.0), inside_[150:151])
    slopes = [one.slopes(rest)[0, :, 0, joint] for one in clearances]
    place = int(np.argmax([np.abs(slope).max() for slope in slopes]))
    row = int(np.argmax(np.abs(slopes[place])))
    calm = 1e-3 * calm  # the rest of the motion comes no nearer than a few micrometres
    height, chosen = 5e-3 / slopes[place][row], clearances[place]  # in units of 0.1 m
    for _ in range(_SECANTS):
        dip = motion(height)
        seen, true = (chosen.values(states_of(dip, x))[:, row].max() for x in (t, inside_))
        height *= 5e-3 / max(true - seen, 1e-3)
    bound = constraint_bounds(lib, [chosen], dip)[row].bound
    return caught, bool(true - seen > 4.5e-3 and bound > (seen + true) / 2)
