"""Noise spectrum in the information of a motion: white is white, exact by frequency, derivative."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from runtime import load
from runtime.excitation import ConditionCost, Trajectory
from runtime.excitation.motion.trajectory import basis_of
from runtime.excitation.search.criteria import log_volume
from runtime.excitation.search.information import ORDER, NoiseSpectrum, information, spectrum_of
from runtime.excitation.search.prediction import covariance_of
from runtime.library import Library
from runtime.recording import Friction
from runtime.recording.friction.model import columns
from runtime.recording.settings import JointMotion
from tests.runtime.conftest import Command
from tests.taylor import assert_second_order, taylor_slope

MOTION = np.array([[0.12, -0.08, 0.04]])
NAMES = ("viscous", "coulomb", "offset")
RED = NoiseSpectrum(np.array([0.1, 1.0, 10.0]), np.array([[9.0], [3.0], [0.5]]), 4.0)


@pytest.fixture(scope="module")
def pendulum(tiny_built: Path) -> Library:
    return load(tiny_built)


def cost(lib: Library, basis: str, spectrum: NoiseSpectrum | None) -> ConditionCost:
    known = replace(information(lib, 0.1, 50.0, friction=NAMES), spectrum=spectrum)
    made = basis_of(basis)
    return ConditionCost(lib, lib.home, made.size(3), 5.0, made, known)


def oracle(lib: Library, motion: Trajectory, spectrum: NoiseSpectrum, samples: int) -> np.ndarray:
    """Covariance of generalised least squares on [Y_b F] with the covariance of the noise."""
    t = np.linspace(0.0, motion.duration, samples)
    q, dq, ddq, _ = motion.at(lib, t)
    rows = np.hstack(
        [lib.base_regressor(q, dq, ddq)[:, 0], columns(JointMotion(dq), Friction(NAMES))[:, 0]]
    )
    frequency = np.arange(samples) / (2 * samples * t[1])
    k = np.arange(samples)
    turn = np.cos(np.pi * np.outer(k, k + 0.5) / samples) * np.sqrt(2 / samples)
    turn[0] /= np.sqrt(2)
    gain = 1 / (1 + (frequency / spectrum.cutoff_hz) ** (2 * ORDER))
    density = np.interp(frequency, spectrum.frequency, spectrum.density[:, 0])
    inverse = turn.T @ np.diag(gain**2 / density) @ turn / 0.1**2
    whole = rows.T @ inverse @ rows * (50.0 * motion.duration / samples)
    return np.linalg.inv(whole)[: len(lib.base_columns), : len(lib.base_columns)]


def test_coloured_noise_is_generalised_least_squares(pendulum: Library) -> None:
    """Oracle: the covariance of the noise as a matrix; the inverse of the information."""
    motion = Trajectory(pendulum.home, MOTION, 5.0)
    known = replace(information(pendulum, 0.1, 50.0, friction=NAMES), spectrum=RED)
    got = covariance_of(pendulum, motion, known, NAMES, 200)
    np.testing.assert_allclose(got, oracle(pendulum, motion, RED, 200), rtol=1e-8)


@pytest.mark.parametrize("basis", ["cosine", "fourier"])
def test_criteria_count_the_spectrum(pendulum: Library, basis: str) -> None:
    """Property: white noise without a filter changes nothing. Derivative: with both, by Taylor."""
    shape = basis_of(basis).size(3)  # functions per joint
    a = np.resize(MOTION, (1, shape))
    white = NoiseSpectrum(np.array([1.0, 9.0]), np.ones((2, 1)))
    plain, same = (cost(pendulum, basis, one).measure(a, log_volume) for one in (None, white))
    assert same[0] == pytest.approx(plain[0], abs=1e-9)
    np.testing.assert_allclose(same[1], plain[1], atol=1e-8 * np.abs(plain[1]).max())
    coloured = cost(pendulum, basis, RED)
    value, slope = coloured.measure(a, log_volume)
    assert value > plain[0] + 0.1  # noise is larger below 1 Hz, where the motion is
    direction = a * np.random.default_rng(1).normal(size=a.shape)
    measured = taylor_slope(
        lambda x: coloured.measure(x.reshape(a.shape), log_volume)[0],
        a.ravel(),
        direction.ravel(),
        float(np.sum(slope * direction)),
    )
    # Friction columns are differentiated by differences (1e-9): two decades fewer.
    assert_second_order(measured, decades=2.5)


def test_spectrum_of_residuals() -> None:
    """Oracle: white noise and its moving mean, whose density is known; a filter's band is kept."""
    rng, rate = np.random.default_rng(0), 100.0
    white = rng.normal(size=(20000, 2))
    mean = np.apply_along_axis(np.convolve, 0, white, np.ones(5) / np.sqrt(5), "valid")
    for rest, law in (
        (white, lambda f: 0 * f + 1),
        (mean, lambda f: (np.sin(np.pi * f / 20) / np.sin(np.pi * f / 100)) ** 2 / 5),
    ):
        got = spectrum_of(rest, rate)
        inside = got.frequency < 15
        # 16 bins in the narrowest band: σ = 0.35, four of them.
        np.testing.assert_allclose(
            got.density[inside].T, np.tile(law(got.frequency[inside]), (2, 1)), rtol=1.4
        )
        wide = (got.frequency > 3) & inside
        np.testing.assert_allclose(
            got.density[wide].mean(axis=0), law(got.frequency[wide]).mean(), rtol=0.1
        )
    assert spectrum_of(white, rate, 10.0).frequency.max() <= 10.0


def test_bad_input(command: Command, pendulum: Library) -> None:
    """Property: one sentence, exit code 2."""
    for words, said in (
        (("--settings", "cutoff=0"), "expected a cut-off above 0 Hz"),
        (("--settings", "noise_model=pink"), "expected --settings noise_model=white or coloured"),
        (("--settings", "noise_model=coloured"), "give --noise LOG"),
        (("--settings", "cutoff=5", "--criterion", "cond"), "counts neither noise nor filter"),
        (("--settings", "cutoff=5", "--until", "a=10%"), "leave out the setting cutoff"),
    ):
        ran = command("excite", "--robot", pendulum.folder, *words)
        assert (ran.code, said in ran.err) == (2, True), ran.err
