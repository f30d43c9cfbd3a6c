"""The shortest session for a target: its expected error by Monte Carlo, its search, its command."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag

from runtime.campaign.shortest_session import (
    DELAY,
    FRICTION,
    GAINS,
    NOISE,
    ModelError,
    _needed,
    error_parts_of,
    shortest_session,
    size_of,
    target_of,
)
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, prior_of
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import JoinedMotion, basis_of
from runtime.excitation.proof.certificate import certificate_of
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import FRICTION as FRICTION_COLUMNS
from runtime.excitation.search.information import information
from runtime.library import Library, load
from runtime.recording import Friction
from runtime.recording.friction.model import columns
from runtime.recording.settings import JointMotion
from tests.runtime.conftest import Command

MOTION = np.array([[0.3, -0.2, 0.2, 0.1]])
"""Cosines and sines: not out and back, so that no part vanishes by symmetry."""


@pytest.fixture(scope="module")
def pendulum(tiny_built: Path) -> Library:
    return load(tiny_built)


def test_the_expected_error_is_that_of_estimates(pendulum: Library) -> None:
    """Oracle: 4000 draws of parameters, noise, gains, delays and friction, each fitted."""
    lib, error = pendulum, ModelError(0.02, 0.01, 0.05, 0.002)
    motion = Trajectory(lib.home, MOTION, 5.0, basis_of("fourier"))
    known = information(lib, 0.05, 20.0)
    expected = error_parts_of(lib, motion, known, error)
    t = np.linspace(0.0, 5.0, 100)
    q, dq, ddq, _ = motion.at(lib, t)
    y = lib.regressor(q, dq, ddq)[:, 0]
    friction = columns(JointMotion(dq), Friction(FRICTION_COLUMNS))[:, 0]
    prior = prior_of(lib)
    shrink = block_diag(*prior.bodies.spread(prior.centre)) / np.sqrt(CAD)
    rng = np.random.default_rng(0)
    of_prior = np.linalg.inv(shrink)
    rows = np.column_stack([y, friction]) / 0.05
    whole = np.vstack([rows, np.hstack([of_prior, np.zeros((len(of_prior), 3))])])
    solve = np.linalg.pinv(whole)[:10]
    tau = y @ lib.pi0
    share, slow = dq[:, 0] / 3.0, 0.05
    sign = np.tanh(share / 0.005)
    level = 0.01 * 10.0
    shapes = (level * sign * np.exp(-np.abs(share) / slow), level * share**3)
    both = (*shapes, 0.05 * np.abs(tau) * sign)
    causes = {
        GAINS: [0.02 * tau],
        FRICTION: [one * side for one in both for side in (dq[:, 0] > 0, dq[:, 0] < 0)],
        DELAY: [0.002 * np.gradient(tau, t)],
    }
    weight = np.sqrt(known.rate * 5.0 / 100) / 0.05
    size = size_of(lib, target_of("v=1Nm"), lib.home, error)
    for name, signals in causes.items():
        z = rng.normal(size=(4000, len(signals)))
        data = np.hstack([weight * z @ np.array(signals), np.zeros((4000, len(of_prior)))])
        drawn = data @ solve.T
        # 4000 draws: 2.2 % for a variance, four and a half of them.
        got = expected[name] @ expected[name].T
        assert lib.base_matrix @ got @ lib.base_matrix.T == pytest.approx(
            lib.base_matrix @ (drawn.T @ drawn / 4000) @ lib.base_matrix.T,
            rel=0.1,
            abs=1e-3 * np.abs(lib.base_matrix @ got @ lib.base_matrix.T).max(),
        )
    assert size(NOISE, expected[NOISE]) > 0


def test_the_shortest_session(pendulum: Library) -> None:
    """Property: the error is within the target, of a much shorter session not; limits kept."""
    lib, known = pendulum, information(pendulum, 0.05, 100.0)
    error = ModelError(gain=0.0005, friction=0.00005, load=0.0005, delay_s=0.0)
    settings = DesignSettings(harmonics=4, starts=1, information=known, safety=Safety())
    found = shortest_session(lib, target_of("v = 8 mNm"), settings, known, error, lambda one: one)
    assert found.total <= 8e-3
    assert found.total == pytest.approx(np.linalg.norm(list(found.parts.values())), rel=1e-12)
    reached = [s for s, sigma in found.attempts.items() if sigma <= 8e-3]
    assert found.duration == min(reached)
    missed = [s for s, sigma in found.attempts.items() if sigma > 8e-3]
    assert found.duration <= 1.15 * max([*missed, 3.0 / 1.15])
    assert certificate_of(lib, found.design.trajectory, Safety()).holds
    # Ways bring seconds, and so a shorter motion or a smaller error.
    twice = error_parts_of(
        lib, JoinedMotion((found.design.trajectory,) * 2, ("approach", "motion")), known, error
    )
    size = size_of(lib, found.target, lib.home, error)
    noise = size(NOISE, twice[NOISE])
    assert noise == pytest.approx(found.parts[NOISE] / np.sqrt(2), rel=0.05)


def test_a_target_below_the_model_error(pendulum: Library) -> None:
    """Property: one sentence with the part that no motion reduces."""
    known = information(pendulum, 0.001, 100.0)
    settings = DesignSettings(harmonics=3, starts=1, information=known, safety=Safety())
    with pytest.raises(IdentificationError, match=r"of which friction beyond the columns .*Nm"):
        shortest_session(
            pendulum,
            target_of("v=1mNm"),
            settings,
            known,
            ModelError(gain=0.0, friction=0.05),
            lambda one: one,
        )


def test_until_on_the_command_line(command: Command, tiny: Path, tmp_path: Path) -> None:
    """Property: error and times are printed and in the file; what it chooses is not given."""
    words = ("excite", "--robot", tiny, "--settings", f"starts={1}", "--until", "v 60 mNm")
    ran = command(*words, "--from", "0.6", "--return", "--out", "u.json")
    assert (ran.code, ran.err.count("Traceback")) == (0, 0), ran.err
    facts = json.loads((tmp_path / "u.json").read_text())
    assert facts["promise"]["sigma"] <= 0.06
    spans = [facts[part]["duration"] for part in ("approach", "return")]
    assert facts["promise"]["session_s"] == pytest.approx(facts["duration"] + sum(spans))
    assert "promised σ" in ran.out
    assert "session: approach" in ran.out
    for more, match in (
        (("--duration", 5), "leave out --duration"),
        (("--criterion", "a"), "leave out --criterion"),
        (("--settings", f"gain_error={2}"), "the setting gain_error is a share"),
    ):
        refused = command(*words, *more, "--out", "w.json")
        assert refused.code == 2
        assert match in refused.err
    refused = command(
        "excite", "--robot", tiny, "--settings", f"gain_error={0.01}", "--out", "w.json"
    )
    assert (refused.code, "give --until, or leave it out" in refused.err) == (2, True)
    refused = command("excite", "--until", "mass=5g")
    assert (refused.code, "expected a target such as" in refused.err) == (2, True)


@pytest.mark.parametrize(("other", "wanted"), [(0.5, 1.02 * 10 * 0.25 / 0.75 - 8), (1.2, np.inf)])
def test_what_more_motion_cannot_reach_takes_for_ever(other: float, wanted: float) -> None:
    """Oracle: σ² = other² + noise² · whole / seconds; errors of sessions alone may exceed it."""
    noise, total = 0.5, float(np.hypot(other, 0.5))
    assert _needed(noise, total, 1.0, 10.0, 2.0) == pytest.approx(wanted)
