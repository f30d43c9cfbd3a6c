"""Certificates of both bundled robots, with an empty hand and with a body, against a dense check.

Nothing of the library is used: motions by closed forms at 20 kHz, torques by Pinocchio's RNEA,
distances by coal. Distances are taken at every millisecond, and at 20 kHz around each smallest one.
"""

from collections.abc import Iterator

import coal
import numpy as np
import pinocchio
import pytest

from runtime import load
from runtime.cli.motion_limits import carried_body
from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import TABLE_MARGIN
from runtime.excitation.limits.safety import Safety
from runtime.excitation.proof.certificate import Certificate, certificate_of, pulled_inside
from runtime.excitation.search.design import design
from runtime.library import Library
from tests.collision_oracle import capsule_of, pair_distances
from tests.oracle import pinocchio_model
from tests.runtime.excitation.test_excitation import closed_form

MASS, COM, EDGES = 1.8, (0.02, -0.01, 0.1), (0.1, 0.16, 0.2)
BODY = ",".join(map(str, (MASS, *COM, *EDGES)))
MARGIN, DURATION, HARMONICS = 0.95, 3.0, 2
DENSE, COARSE = 20_000, 1000
"""Rates of the check, Hz."""
Case = tuple[Library, Safety, Trajectory, Certificate]


@pytest.fixture(scope="module", params=["fr3", "ur5e"])
def robot(request: pytest.FixtureRequest) -> Library:
    return load(request.param)


@pytest.fixture(scope="module", params=[None, BODY], ids=["empty hand", "body"])
def case(robot: Library, request: pytest.FixtureRequest) -> Case:
    """An exported motion over a table: limits beyond those of the joints, and 5 % left of each."""
    safety = Safety(table=0.0, carried=carried_body(robot, request.param))
    shape = {"duration": DURATION, "harmonics": HARMONICS, "starts": 1}
    optimum = design(robot, safety=safety, margin=MARGIN, **shape).trajectory
    motion = pulled_inside(robot, optimum, share=MARGIN)
    return robot, safety, motion, certificate_of(robot, motion, safety)


def states(motion: Trajectory, rate: float, t: np.ndarray | None = None) -> np.ndarray:
    """q, dq, ddq, dddq at a rate or at instants, (4, N, n)."""
    if t is None:
        t = np.arange(int(motion.duration * rate) + 1) / rate
    phi = closed_form(HARMONICS, t, motion.duration)
    values = np.stack([phi[..., k] @ motion.coefficients.T for k in range(4)])
    values[0] += motion.home
    return values


def loaded_model(lib: Library, safety: Safety) -> pinocchio.Model:
    """The robot with a homogeneous box welded to its tip where it carries one."""
    model = pinocchio_model(lib.urdf())
    if safety.carried is not None:
        tip = model.frames[model.getFrameId(lib.manifest.tip, pinocchio.BODY)]
        moment = MASS / 12 * (np.sum(np.square(EDGES)) - np.square(EDGES))
        box = pinocchio.Inertia(MASS, np.array(COM), np.diag(moment))
        model.appendBodyToJoint(tip.parentJoint, box, tip.placement)
    return model


def use(proof: Certificate, kind: str) -> float:
    return next(each.bound for each in proof.uses if each.kind == kind)


def test_uses_hold_at_20_khz(case: Case) -> None:
    """Oracle: closed forms and Pinocchio; the certificate is above the samples, and not by much."""
    lib, safety, motion, proof = case
    limits = lib.limits()
    values = states(motion, DENSE)
    q, dq, ddq, dddq = values
    model = loaded_model(lib, safety)
    data = model.createData()
    tau = np.array([pinocchio.rnea(model, data, *s) for s in zip(q, dq, ddq, strict=True)])
    home = motion.home
    room = np.where(q > home, limits["upper"] - home, home - limits["lower"])
    dense = {"position": np.abs(q - home) / room, "torque": np.abs(tau) / limits["effort"] / 0.95}
    for kind, each in (("velocity", dq), ("acceleration", ddq), ("jerk", dddq)):
        dense[kind] = np.abs(each) / limits[kind]
    rate = np.abs(np.diff(tau, axis=0)) * DENSE
    dense["torque rate"] = rate / limits["torque_rate"]
    checked = {each.kind for each in proof.uses}
    assert {"position", "torque", "self-collision", "table"} <= checked
    assert proof.holds
    for kind in checked & dense.keys():
        largest = float(np.nanmax(np.where(np.isfinite(dense[kind]), dense[kind], 0.0)))
        # Rounding, with differences of torques of 100 N·m over 50 µs.
        assert largest <= use(proof, kind) + 1e-6, kind
        assert largest >= use(proof, kind) - 0.01, kind
        if kind != "jerk":
            assert use(proof, kind) <= MARGIN + 1e-8


class Scene:
    """Proxies, box and table in coal, moved by Pinocchio."""

    def __init__(self, lib: Library, safety: Safety) -> None:
        self._model = pinocchio_model(lib.urdf())
        self._placed = {p.name: (p.joint + 1, *capsule_of(p)) for p in lib.proxies}
        self.margins = {(pair.first, pair.second): pair.margin for pair in lib.pairs}
        lifted = list(lib.moving_proxies)
        if safety.carried is not None:
            tip = self._model.frames[self._model.getFrameId(lib.manifest.tip, pinocchio.BODY)]
            centre = tip.placement * pinocchio.SE3(np.eye(3), np.array(COM))
            self._placed["carried body"] = (tip.parentJoint, coal.Box(*EDGES), centre)
            widest = max(pair.margin for pair in lib.pairs)
            others = [p.name for p in lib.proxies if p.joint + 1 != tip.parentJoint]
            self.margins |= {("carried body", name): widest for name in others}
            lifted.append("carried body")
        self.margins |= {(name, "table"): TABLE_MARGIN for name in lifted}

    def distances(self, q: np.ndarray, pairs: list[tuple[str, str]]) -> Iterator[list[float]]:
        """Distance of every pair at every position, m."""
        return pair_distances(self._model, self._placed, 0.0, q, pairs)


def test_distances_hold_at_20_khz(case: Case) -> None:
    """Oracle: coal; every pair keeps its margin, and the certificate states the smallest ones."""
    lib, safety, motion, proof = case
    scene = Scene(lib, safety)
    # The lowest links turn about the vertical above the table: their height does not change.
    fixed = {name for name, joint in ((p.name, p.joint) for p in lib.proxies) if joint <= 0}
    pairs = [pair for pair in scene.margins if not (pair[1] == "table" and pair[0] in fixed)]
    coarse = np.array(list(scene.distances(states(motion, COARSE)[0], pairs)))
    smallest = {}
    for column, pair in enumerate(pairs):
        near = np.argmin(coarse[:, column]) / COARSE
        t = np.clip(near + np.arange(-20, 21) / DENSE, 0.0, motion.duration)
        rows = scene.distances(states(motion, DENSE, t)[0], [pair])
        smallest[pair] = min(float(coarse[:, column].min()), *(row[0] for row in rows))
    # GJK of coal ends at 1e-6 m.
    short = {p: d - scene.margins[p] for p, d in smallest.items() if d < scene.margins[p] - 2e-6}
    assert not short
    for kind in ("self-collision", "table"):
        measured = min(d for p, d in smallest.items() if (p[1] == "table") == (kind == "table"))
        stated = min(each.value for each in proof.distances if each.kind == kind)
        closest = min(
            (d - scene.margins[p], d)
            for p, d in smallest.items()
            if (p[1] == "table") == (kind == "table")
        )[0]
        spare = min(each.value - each.limit for each in proof.distances if each.kind == kind)
        # Between samples the certificate counts what it has not seen: some tenths of a millimetre.
        assert stated <= measured + 2e-6, kind
        assert closest - 1e-3 <= spare <= closest + 2e-6, kind
