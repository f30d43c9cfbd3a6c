"""Akaike's criterion of the friction models, computed by hand."""

import numpy as np
import pytest

from runtime.estimators.choice import friction_choice
from runtime.estimators.choice.friction_choice import choose_friction
from runtime.library import Library
from runtime.recording import Recording, Split
from runtime.recording.friction.model import columns
from runtime.recording.settings import JointMotion

SIGMA, EPSILON = 0.02, 0.03


def test_aic_by_hand(
    lib: Library, ideal_runs: tuple[Recording, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: N_eff ln(χ²/N) + 2 p by numpy's least squares on [Y_b F], with N equations.

    The noise of the joints and N/N_eff = 3 are given, so that nothing else enters.
    """
    inflation = 3.0
    given = np.full(7, 1 / SIGMA**2), inflation
    monkeypatch.setattr(friction_choice, "_noise", lambda *_: given)
    run = ideal_runs[0]
    rng = np.random.default_rng(5)
    tau = run.tau + 0.4 * run.dq + SIGMA * rng.normal(size=run.tau.shape)
    names = ("none", "offset", "viscous", "coulomb")
    parts = Split((0.0, 0.8), (0.8, 0.9), (0.9, 1.0))
    choice = choose_friction(
        run.replace(tau=tau), lib, split=parts, coulomb_speed=EPSILON, names=names
    )
    seen = run.t < run.t[0] + 0.9 * run.duration
    q, dq, ddq, tau = (x[seen] for x in (run.q, run.dq, run.ddq, tau))
    rigid = lib.base_regressor(q, dq, ddq)
    by_hand, parameters = [], []
    for candidate in choice.candidates:
        c = columns(JointMotion(dq, q, ddq, lib), candidate.terms)
        friction = np.zeros((len(q), 7, 7, c.shape[2]))
        friction[:, np.arange(7), np.arange(7)] = c
        rows = np.concatenate([rigid, friction.reshape(len(q), 7, -1)], axis=2)
        flat, target = rows.reshape(7 * len(q), -1), tau.ravel()
        x, _, rank, _ = np.linalg.lstsq(flat, target)
        square = float(np.sum((flat @ x - target) ** 2)) / SIGMA**2
        by_hand.append(len(target) / inflation * np.log(square / len(target)) + 2 * rank)
        parameters.append(int(rank))
    assert [each.parameters for each in choice.candidates] == parameters == [43, 50, 57, 64]
    # Sums of 7000 squares: 1e-12 of N_eff ln.
    np.testing.assert_allclose([each.aic for each in choice.candidates], by_hand, rtol=1e-8)
