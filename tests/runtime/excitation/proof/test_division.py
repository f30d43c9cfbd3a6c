"""division: proven bounds between samples, against spikes and dips that no sample sees."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from runtime.excitation import Trajectory
from runtime.excitation.limits.constraints import constraints
from runtime.excitation.limits.nonlinear_limits import IntervalBounds
from runtime.excitation.limits.safety import Safety
from runtime.excitation.proof.bounds import MotionGrid, constraint_bounds
from runtime.excitation.proof.certificate import certificate_of
from runtime.library import Library
from tests.runtime.excitation.proof.spiked import Spiked

BAND = (0.0,) * 60 + (0.5, *(0.1,) * 9)
"""Half-widths of the parameters of the last link."""
SAFETY = Safety(table=0.0, box=(0.2, 0.8, -0.6, 0.6, 0.2, 1.0), viscous=(2.0,))
DURATION = 2.0


def spiked_motion(lib: Library, joint: int, height: float, size: float) -> Trajectory:
    """A calm motion with a bump of 0.9 ms between two samples of 1 kHz.

    Bumps of 0.3 ms take twenty times as long; `scripts/check_proofs` plants those.
    """
    a = size * np.random.default_rng(5).normal(size=(7, 4))
    spikes = np.zeros((7, 1))
    spikes[joint] = height
    basis = Spiked((round(0.3 * DURATION / 1e-3) + 0.5) * 1e-3 / DURATION, 0.45e-3 / DURATION)
    return Trajectory(lib.home, np.hstack([a, spikes]), DURATION, basis)


def at_samples(lib: Library, motion: Trajectory, kind: str, times: np.ndarray) -> float:
    constraint = next(x for x in constraints(lib, lib.home, SAFETY) if x.kind == kind)
    return float(constraint.values(np.stack(motion.at(lib, times))).max())


def test_a_spike_of_torque_between_samples_is_caught(
    lib: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Adversary: torque above its limit between two samples, where measured bends see nothing."""
    motion = spiked_motion(lib, 1, 8e-7, 1e-3)
    t = np.arange(2001) * 1e-3
    spike = motion.basis.middle * DURATION + np.linspace(-4.5e-4, 4.5e-4, 601)
    assert at_samples(lib, motion, "torque", t) < 0 < at_samples(lib, motion, "torque", spike)
    torque = [x for x in constraints(lib, lib.home, SAFETY) if x.kind == "torque"]
    bounds = [each.bound for each in constraint_bounds(lib, torque, motion)]
    assert max(bounds) > at_samples(lib, motion, "torque", spike)
    monkeypatch.setattr(Library, "bounds_motions", False)
    measured = constraint_bounds(lib, torque, motion)
    assert max(each.bound for each in measured) < 0
    assert not any(each.is_proven for each in measured)


def test_a_dip_of_a_distance_between_samples_is_caught(lib: Library) -> None:
    """Adversary: the table comes 0.5 mm nearer, below a margin that all samples keep."""
    motion = spiked_motion(lib, 1, 1.1e-3, 1e-5)  # rad; the hand is 0.45 m from the axis of joint 2
    t = np.arange(2001) * 1e-3
    spike = motion.basis.middle * DURATION + np.linspace(-4.5e-4, 4.5e-4, 601)
    table = next(x for x in constraints(lib, lib.home, SAFETY) if x.kind == "table")
    row = len(table.labels) - 1
    seen, true = (table.distances(np.stack(motion.at(lib, x)))[:, row].min() for x in (t, spike))
    assert 3e-4 < seen - true < 8e-4
    raised = replace(table, margin=(seen + true) / 2)
    bound = constraint_bounds(lib, [raised], motion)[row]
    assert bound.is_proven
    distance, margin, _ = raised.measured(row, bound.bound)
    assert distance < margin
    assert true - 1e-5 <= distance <= true  # its tolerance: 1 % of the margin that is missing


@pytest.mark.parametrize(
    "more", [{}, {"band": BAND}, {"viscous": (2e4,)}], ids=["one model", "band", "friction alone"]
)
@pytest.mark.parametrize("kind", ["torque", "torque rate", "tip box", "tip speed", "table"])
def test_no_value_exceeds_its_rise(lib: Library, kind: str, more: dict[str, Any]) -> None:
    """Property: in random intervals of all lengths g is below the larger end plus its rise."""
    rng = np.random.default_rng(8)
    motion = Trajectory(lib.home, 4e-3 * rng.normal(size=(7, 8)), DURATION)
    grid = MotionGrid(motion)
    safety = replace(SAFETY, **more)
    constraint = next(x for x in constraints(lib, lib.home, safety) if x.kind == kind)
    for step in (1e-4, 1e-2, 0.1):
        first = rng.uniform(0, DURATION - step, 20)
        t = first[:, None] + step * np.linspace(0, 1, 33)
        g = constraint.values(np.stack(motion.at(lib, t.ravel()))).reshape(20, 33, -1)
        states = motion.basis.derivatives(5, 8, t[:, [0, -1]].ravel() / DURATION)
        states = states @ motion.coefficients.T / DURATION ** np.arange(5.0)[:, None, None]
        states[0] += lib.home
        bounds = IntervalBounds(lib, grid.suprema(states[:, ::2], states[:, 1::2], step), step)
        rise = constraint.rise(bounds)
        excess = g.max(axis=1) - np.maximum(g[:, 0], g[:, -1])
        assert (excess <= rise + 1e-12 * np.maximum(1, np.abs(g).max())).all()  # of sums of squares


def test_robots_without_kernels_of_bounds_are_measured(
    lib: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: the certificate says which limits it could not prove."""
    monkeypatch.setattr(Library, "bounds_motions", False)
    motion = Trajectory(lib.home, 1e-3 * np.ones((7, 2)), DURATION)
    proof = certificate_of(lib, motion, SAFETY)
    sentence = next(text for text in proof.sentences() if text.startswith("torque:"))
    assert sentence.endswith("(measured at 1 kHz)")
    assert {use.kind for use in proof.uses if use.is_proven} == {
        *("position", "velocity", "acceleration", "jerk", "braking")
    }
