"""regressor_choice: the cut-off that predicts the unfiltered torque, and the delay of a torque."""

from dataclasses import replace

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.choice.regressor_choice import CANDIDATES, choose_cutoff
from runtime.library import Library
from runtime.recording import Friction, Preparation, Recipe
from runtime.recording.preprocessing import prepare
from runtime.recording.preprocessing.segments import advance_torque

TERMS = Friction(("viscous", "coulomb"))


def _noisy(recording: Recording, noise: float) -> Recording:
    """White noise on q; dq and ddq have to come from it."""
    draw = np.random.default_rng(1).normal(0, noise, recording.q.shape)
    return recording.replace(q=recording.q + draw, dq=None, ddq=None)


def test_cutoff_follows_the_noise(lib: Library, noisy: Recording) -> None:
    """Property: ten times more noise in q asks for a lower cut-off, none for the highest scores."""
    result = [choose_cutoff(_noisy(noisy, s), lib, friction=TERMS) for s in (1e-5, 1e-3)]
    low, high = (choice.chosen.cutoff_hz for choice in reversed(result))
    assert low < high
    for choice in result:
        assert choice.chosen.excess <= 0.005 * min(c.score for c in choice.candidates)
        assert choice.preparation.cutoff_hz == choice.chosen.cutoff_hz
        assert choice.preparation.trim_s == 1.0 / choice.chosen.cutoff_hz
        assert f"cut-off {choice.chosen.cutoff_hz:g} Hz chosen" in choice.sentence


def test_noise_of_the_torque_is_the_same_for_all(lib: Library, noisy: Recording) -> None:
    """Property: with exact positions a high cut-off scores as well as any, however noisy τ is.

    Held against the filtered torque, it would score six times worse: 3 Hz remove most noise.
    """
    tau = noisy.tau + np.random.default_rng(4).normal(0, 1.0, noisy.tau.shape)
    recording = noisy.replace(tau=tau, dq=None, ddq=None)
    choice = choose_cutoff(recording, lib, friction=TERMS)
    highest = max(choice.candidates, key=lambda c: c.cutoff_hz)
    assert highest.cutoff_hz == 30.0
    assert highest.score < 1.2


def test_a_wide_band_wins_nothing_by_itself(lib: Library, noisy: Recording) -> None:
    """Property: where parameters are equally good, the band of the prediction decides nothing.

    With exact positions 5 Hz find the parameters that 30 Hz find, and repeat less of the
    torque's Coulomb steps: scored each with its own motion, 5 Hz would score 40 % worse.
    """
    choice = choose_cutoff(noisy.replace(dq=None, ddq=None), lib, friction=TERMS)
    scores = {c.cutoff_hz: c.score for c in choice.candidates}
    assert scores[5.0] < 1.005 * scores[30.0]
    assert choice.chosen.cutoff_hz < 30.0


def test_cutoff_is_the_one_that_finds_the_truth(lib: Library, noisy: Recording, pi_true) -> None:
    """Oracle: base parameters fitted at the choice err less than at both ends of the candidates."""
    from runtime.estimators.regression.factor import compress
    from runtime.estimators.regression.samples import samples_of

    recording = _noisy(noisy, 3e-4)
    choice = choose_cutoff(recording, lib, friction=TERMS)

    def error(cutoff: float) -> float:
        ready = replace(choice.preparation, cutoff_hz=cutoff, trim_s=0.5)
        rows = samples_of(prepare(recording, ready, TERMS, lib=lib), lib)
        matrix, lengths = compress(lib, rows, np.ones(7)).unit_columns()
        target = compress(lib, rows, np.ones(7)).target
        beta = (np.linalg.lstsq(matrix, target, rcond=None)[0] / lengths)[: len(lib.base_columns)]
        s = samples_of(prepare(noisy, Preparation(), TERMS, lib=lib), lib)
        truth = lib.base_inverse_dynamics(s.q, s.dq, s.ddq, lib.base_matrix @ pi_true)
        return float(np.linalg.norm(lib.base_inverse_dynamics(s.q, s.dq, s.ddq, beta) - truth))

    tried = [c.cutoff_hz for c in choice.candidates]
    best = error(choice.chosen.cutoff_hz)
    assert best < error(tried[0])
    assert best < error(tried[-1])


def test_measured_velocity_is_kept_unless_it_is_worse(lib: Library, noisy: Recording) -> None:
    """Property: a clean measured dq beside a noisy q is kept, a noisy one is not used."""
    rough = _noisy(noisy, 1e-3).replace(dq=noisy.dq)
    kept = choose_cutoff(rough, lib, friction=TERMS)
    assert kept.preparation.derivative == "measured"
    shaken = noisy.dq + np.random.default_rng(2).normal(0, 0.3, noisy.dq.shape)
    aside = choose_cutoff(noisy.replace(dq=shaken, ddq=None), lib, friction=TERMS)
    assert aside.preparation.derivative == "position"
    assert "are not used" in aside.sentence


def test_bad_input(lib: Library, noisy: Recording) -> None:
    """Property: too few rows and too slow a clock are sentences."""
    with pytest.raises(IdentificationError, match="too few to choose a cut-off"):
        choose_cutoff(noisy.take(slice(0, 30), "short"), lib, Preparation(rate_hz=20.0))
    slow = noisy.replace(t=noisy.t * 100)
    with pytest.raises(
        IdentificationError, match=r"expected a rate above 2\.5 Hz to choose a cut-off, got 1 Hz"
    ):
        choose_cutoff(slow, lib)
    assert min(CANDIDATES) == 1.0


def test_advanced_torque(noisy: Recording) -> None:
    """Closed form: τ = sin(t − δ) advanced by δ is sin t, and no segment borrows from another."""
    t = np.concatenate([np.arange(0, 2, 0.01), np.arange(3, 5, 0.01)])
    q = np.zeros((len(t), 1))
    late = Recording(t=t, q=q, tau=np.sin(t - 0.033)[:, None])
    back = advance_torque(late, 0.033)
    # Linear interpolation of a sine at 100 Hz: h²/8 = 1.25e-5.
    np.testing.assert_allclose(back.tau[:, 0], np.sin(back.t), atol=1.3e-5)
    assert len(back) == len(t) - 2 * 4
    assert "Advanced τ by 33 ms" in back.history[-1]
    early = prepare(late, Preparation(torque_delay_s=-0.02))
    assert len(early) == len(t) - 2 * 2
    with pytest.raises(RecordingError, match="expects τ"):
        advance_torque(late.replace(tau=None), 0.01)
    with pytest.raises(RecordingError, match="torque_delay_s expects a number"):
        Recipe(preparation=Preparation(torque_delay_s=float("nan")))


def test_the_test_part_has_no_effect(lib: Library, noisy: Recording) -> None:
    """Property: garbage in the last 40 % changes no figure of the choice, to the bit."""
    tau = noisy.tau.copy()
    first = int(np.flatnonzero(noisy.t - noisy.t[0] >= 0.6 * noisy.duration)[0])
    tau[first:] = 20.0 * np.random.default_rng(0).normal(size=tau[first:].shape)
    whole, damaged = (
        choose_cutoff(each.replace(dq=None, ddq=None), lib, friction=TERMS)
        for each in (noisy, noisy.replace(tau=tau))
    )
    assert whole == damaged
