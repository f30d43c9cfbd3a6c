"""Several motions that share a time: their information adds up, and the later ones complement."""

import runpy
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from runtime import load
from runtime.excitation import Trajectory
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.excitation.search.design import design_several, torque_sigma, with_motion
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import NoiseSpectrum, information
from runtime.excitation.search.prediction import covariance_of
from runtime.library import Library
from tests.runtime.conftest import Command

NAMES = ("viscous", "coulomb", "offset")


@pytest.fixture(scope="module")
def pendulum(tiny_built: Path) -> Library:
    return load(tiny_built)


@pytest.mark.parametrize("cutoff", [None, 2.0])
def test_information_of_a_motion(pendulum: Library, cutoff: float | None) -> None:
    """Oracle: the inverse of the covariance by least squares on [Y_b F], over as many samples."""
    known = information(pendulum, 0.1, 50.0, friction=NAMES)
    if cutoff is not None:
        spectrum = NoiseSpectrum(np.array([0.1, 5.0]), np.array([[4.0], [1.0]]), cutoff)
        known = replace(known, spectrum=spectrum)
    motion = Trajectory(pendulum.home, np.array([[0.12, -0.08, 0.04]]), 5.0)
    got = with_motion(pendulum, motion, known).earlier
    spread = covariance_of(pendulum, motion, known, NAMES, 240)
    np.testing.assert_allclose(got @ spread, np.eye(len(spread)), atol=1e-8)
    twice = with_motion(pendulum, motion, with_motion(pendulum, motion, known))
    np.testing.assert_allclose(twice.earlier, 2 * got, rtol=1e-12)


def test_a_later_motion_complements(pendulum: Library) -> None:
    """Property: both motions share the time, and the second lowers σ more than the first again."""
    known = information(pendulum, 0.1, 50.0, friction=NAMES)
    settings = DesignSettings(duration=4.0, harmonics=3, starts=1, criterion="v", information=known)
    first, second = (each.trajectory for each in design_several(pendulum, settings, 2))
    assert first.duration == second.duration == 2.0
    once = with_motion(pendulum, first, known)
    both, again = (with_motion(pendulum, one, once) for one in (second, first))
    sigma = [torque_sigma(pendulum, pendulum.home, one) for one in (once, again, both)]
    assert sigma[0] / np.sqrt(2) == pytest.approx(sigma[1], rel=1e-9)
    assert sigma[2] <= sigma[1] * (1 + 1e-3)  # to the tolerance of a search


def test_the_command(command: Command, pendulum: Library, tmp_path: Path) -> None:
    """Property: one file per motion, none replaced; options of one motion are refused by name."""
    words = ("excite", "--robot", pendulum.folder, "--settings", "motions=2", "--duration", "4")
    words += (
        "--settings",
        "starts=1",
        "--settings",
        "harmonics=3",
        "--criterion",
        "v",
        "--out",
        "m.json",
    )
    refused = command(*words, "--export", "csv")
    assert (refused.code, "--export does not apply" in refused.err) == (2, True)
    ran = command(*words)
    assert ran.code == 0, ran.err
    assert "by the logs so far" in ran.out
    for k in (1, 2):
        assert read_trajectory(tmp_path / f"m-{k}.json", pendulum).duration == 2.0
        assert (tmp_path / f"m-{k}.motion.csv").exists()
    again = command(*words)
    assert (again.code, "m-1.json" in again.err) == (2, True)


def test_differences_are_paired(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the interval of a paired t-test; designs share their robots, so means do not do."""
    scripts = Path(__file__).parents[4] / "scripts"
    monkeypatch.setattr(sys, "path", [str(scripts), *sys.path])
    table = runpy.run_path(str(scripts / "motions_table"), run_name="motions_table")["table"]
    one, four = [7.0, 9.0, 5.0, 6.0], [6.0, 7.5, 4.5, 5.0]
    band = stats.ttest_rel(four, one).confidence_interval()
    row = table({1: one, 4: four}, {1: one, 4: four}).splitlines()[-1]
    assert row.endswith(f"| -1.00 ({band.low:+.2f} to {band.high:+.2f}) |")
