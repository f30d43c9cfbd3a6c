"""What differs between days is learnt while the observer runs, contacts are not."""

import numpy as np
import pytest

from runtime.monitoring.observation import BLOCK_S, DRY, HOLD_BLOCKS, VISCOUS, usual_torque

RATE_HZ, SIGMA = 100.0, 0.3


def motion(seconds: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, features of one joint with friction of 5 N·m and noise of r, (N, 1)."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    speed = np.sin(2 * np.pi * 0.3 * t)
    features = np.stack([np.ones_like(t), 5 * speed, 3 * np.tanh(20 * speed)], axis=1)
    noise = SIGMA * np.random.default_rng(seed).standard_normal((len(t), 1))
    return t, features[:, None, :], noise


def test_bias_and_friction_of_a_session_are_learnt() -> None:
    """Oracle: a bias of 13 N·m and friction that is two deviations off, to σ of what remains.

    Half of the changes of friction is left within the first minute: 0.1 of 0.7 N·m.
    """
    _, features, noise = motion(60.0)
    theta = np.array([13.0, 2 * VISCOUS, -2 * DRY])
    r = features @ theta + noise
    usual, variance = usual_torque(r, features, np.array([SIGMA]), RATE_HZ)
    rest = (r - usual)[100:]
    assert np.sqrt(np.mean(rest**2)) < 1.1 * SIGMA
    assert np.mean(rest**2 / (SIGMA**2 + variance[100:])) == pytest.approx(1.0, abs=0.2)
    assert variance[0, 0] > (10 * SIGMA) ** 2  # no contact is found before the bias is known


@pytest.mark.parametrize(("seconds", "lasts"), [(5.0, True), (30.0, False)])
def test_a_contact_is_not_learnt_but_a_bias_is(seconds: float, lasts: bool) -> None:
    """Property: 3 N·m for 5 s remain in r until they end, for 30 s they become a bias."""
    t, features, noise = motion(60.0)
    push = (3.0 * ((t >= 20) & (t < 20 + seconds)))[:, None]
    usual, _ = usual_torque(noise + push, features, np.array([SIGMA]), RATE_HZ)
    rest = noise + push - usual
    end = (t >= 19 + seconds) & (t < 20 + seconds)
    assert np.median(rest[end]) == pytest.approx(3.0 if lasts else 0.0, abs=0.3)
    held = (t >= 20.2) & (t < 20 + min(seconds, HOLD_BLOCKS * BLOCK_S - 1))
    assert np.median(rest[held]) == pytest.approx(3.0, abs=0.3)
    if lasts:
        assert np.abs(np.median(rest[t > 26])) < 0.1
