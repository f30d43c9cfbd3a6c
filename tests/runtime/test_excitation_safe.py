"""A design with all limits of the FR3, checked by formulas of its own on a 1 kHz grid."""

import numpy as np
import pinocchio
import pytest

from runtime.certificate import certificate, pulled_inside
from runtime.errors import IdentificationError
from runtime.excitation import Design, Safety, design
from runtime.excitation.search import Problem, Search
from runtime.library import Library
from tests.oracle import pinocchio_model
from tests.runtime.test_excitation import closed_form

SAFETY = Safety(table=0.0)
DURATION, HARMONICS = 4.0, 3


@pytest.fixture(scope="module")
def found(lib: Library) -> Design:
    return design(lib, DURATION, HARMONICS, starts=1, safety=SAFETY)


def test_all_limits_hold_at_1_khz(lib: Library, found: Design) -> None:
    """Oracle: closed forms of the motion, Pinocchio's RNEA, the manufacturer's speeds."""
    duration, home = found.trajectory.duration, found.trajectory.home
    t = np.arange(int(duration * 1000) + 1) / 1000
    phi = closed_form(HARMONICS, t, duration)
    q, dq, ddq = (phi[..., k] @ found.trajectory.coefficients.T for k in range(3))
    q += home
    limits = lib.limits()
    slack = 1 + 1e-11  # rounding of coefficients of 70 that cancel down to 1
    assert ((q >= limits["lower"]) & (q <= limits["upper"])).all()
    assert (np.abs(dq) <= limits["velocity"] * slack).all()
    assert (np.abs(ddq) <= limits["acceleration"] * slack).all()
    facts = lib.braking
    assert facts is not None
    assert (dq <= -facts.c + np.sqrt(facts.k * (facts.upper - q))).all()
    assert (dq >= facts.c - np.sqrt(facts.k * (q - facts.lower))).all()
    model = pinocchio_model(lib.urdf())
    data = model.createData()
    tau = np.array([pinocchio.rnea(model, data, *state) for state in zip(q, dq, ddq, strict=True)])
    assert (np.abs(tau) <= 0.95 * limits["effort"]).all()
    margins = np.array([pair.margin for pair in lib.pairs])
    assert (lib.clearance(q)[0] >= margins).all()
    heights = lib.plane_clearance(q, np.array([0.0, 0.0, 1.0, 0.0]))[0]
    above = np.array(lib.moving_proxies) != "link1"
    assert (heights[:, above] >= 0.03).all()
    # Limits that are not linear were tightened by 2e-3 of themselves and are used up to there.
    assert max(found.use[kind] for kind in ("braking", "self-collision", "table")) > 0.99
    assert found.unchecked == ()


def test_its_certificate_holds(lib: Library, found: Design) -> None:
    """Property: between samples too, at full and at half speed."""
    motion = pulled_inside(lib, found.trajectory)
    proof = certificate(lib, motion, SAFETY)
    assert proof.holds
    for use in proof.uses:
        if use.kind in found.use:
            # The chord's error of a millisecond; 1e-3 of 0.1 m.
            assert use.bound == pytest.approx(found.use[use.kind], abs=1e-3), use.kind


def test_the_document_forgets_the_table(lib: Library) -> None:
    """Property: without the limits the same start breaks some, and nobody claims otherwise."""
    free = design(lib, DURATION, HARMONICS, starts=1)
    assert free.unchecked == ("torque", "self-collision", "table")
    assert not certificate(lib, free.trajectory, SAFETY).holds


def test_no_room_is_explained(lib: Library) -> None:
    """Property: a box around the tip of 20 nm leaves nothing; the sentence names what stops it."""
    p = lib.tip_motion(lib.home, np.zeros(7))[0].ravel()
    ends = np.stack([p - 1e-8, p + 1e-8], axis=1).ravel()
    problem = Problem(*(lib.folder, lib.level, lib.home, 2, 4.0, 0), safety=Safety(box=tuple(ends)))
    search = Search(lib, problem)
    with pytest.raises(IdentificationError, match=r"no room for a motion.*tip box \(. m..\) and"):
        search._shrunk(search._random(0), 0.0)
