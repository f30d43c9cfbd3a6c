"""Draws from the posterior: the right distribution, consistent bodies, files that reload."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import chi2, kstest

from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import bodies_of
from runtime.library import Library
from runtime.library.parameters import links, mass
from runtime.monitoring import posterior_draws
from runtime.monitoring.posterior_draws import draw_models
from runtime.simulation.box_payload import pi_from_pseudo
from tests.runtime.conftest import Command
from tests.runtime.monitoring.conftest import Monitored

COUNT = 400


@pytest.mark.parametrize(("step", "count"), [(0.25, 12), (0.6, 40)])
def test_without_data_the_draws_are_those_of_wishart(
    lib: Library, monitored: Monitored, monkeypatch: pytest.MonkeyPatch, step: float, count: int
) -> None:
    """Oracle: exp(−κ tr P0⁻¹P) det Pᵏ is Wishart's density with 2κ + 5 degrees of freedom.

    2κ tr(P0⁻¹ P) of every link is χ² with 4 (2κ + 5) degrees of freedom: Kolmogorov–Smirnov over
    all links at the probability 0.001. Of long steps, whose energies err, trajectories are refused.
    """
    monkeypatch.setattr(posterior_draws, "STEP", step)
    monkeypatch.setattr(posterior_draws, "TRAJECTORIES", count)
    known = monitored.posterior.information
    statistics = dataclasses.replace(
        known.statistics,
        factor=np.zeros_like(known.statistics.factor),
        target=np.zeros_like(known.statistics.target),
    )
    blind = dataclasses.replace(
        monitored.posterior,
        information=dataclasses.replace(known, statistics=statistics),
        pi_root=np.zeros((lib.pi0.size, lib.pi0.size)),
        phi_nuisance=None,
    )
    draws = draw_models(lib, monitored.saved, blind, COUNT, np.random.default_rng(0))
    inverse = np.linalg.inv(lib.pseudo_inertia(known.centre))
    P = lib.pseudo_inertia(draws.pi).reshape(COUNT, -1, 4, 4)
    traces = np.einsum("kij,nkji->nk", inverse, P)
    law = chi2(4 * (2 * known.kappa + 5))
    assert kstest(2 * known.kappa * traces.ravel(), law.cdf).pvalue > 1e-3
    assert draws.effective > 0.5 * COUNT or draws.acceptance < 0.97


def test_with_many_data_the_draws_are_normal(lib: Library, monitored: Monitored) -> None:
    """Oracle: information 10⁴ times that of the prior leaves a normal law of known covariance.

    The first friction coefficient depends on the first base parameter, to which an error of
    the estimate of twice its σ is added: friction follows it. Nuisance torque moves the second one
    alone, by twice its σ. 400 draws determine a standard
    deviation to 3.5 %, four of these for each of 64 values, and this correlation to 0.005.
    """
    known = monitored.posterior.information
    bodies, n_base = bodies_of(lib), len(lib.base_matrix)
    prior = lib.base_matrix @ block_diag(*bodies.spread(known.centre)) / np.sqrt(known.kappa)
    covariance = prior @ prior.T / 1e4
    factor = np.zeros_like(known.statistics.factor)
    factor[:n_base, :n_base] = np.linalg.cholesky(np.linalg.inv(covariance)).T
    factor[n_base:, n_base:] = 10.0 * np.eye(len(factor) - n_base)
    first = np.sqrt(covariance[0, 0])
    factor[n_base, 0] = 4 / 3 / first  # φ₁ = 5 ∓ 0.1 · 4/3 per σ of β₁, ± 0.1
    error = np.linalg.lstsq(lib.base_matrix, 2 * first * np.eye(n_base)[0], rcond=None)[0]
    phi = np.full_like(monitored.saved.phi, 5.0)
    truth = np.concatenate([lib.base_matrix @ known.centre, phi.ravel()])
    statistics = dataclasses.replace(known.statistics, factor=factor, target=factor @ truth)
    sharp = dataclasses.replace(
        monitored.posterior,
        information=dataclasses.replace(known, statistics=statistics, density=1.0),
        pi=known.centre,
        pi_root=np.column_stack([np.zeros((lib.pi0.size, lib.pi0.size + 1)), error]),
        phi_nuisance=0.2 * np.eye(phi.size)[:, 1:2],
    )
    saved = dataclasses.replace(monitored.saved, pi=known.centre, phi=phi)
    draws = draw_models(lib, saved, sharp, COUNT, np.random.default_rng(1))
    assert (lib.relative_eigenvalues(draws.pi) > 0).all()
    values = np.hstack([draws.pi @ lib.base_matrix.T, draws.phi.reshape(COUNT, -1)])
    sigma = np.sqrt([*np.diag(covariance), *np.full(phi.size, 0.01)])
    sigma[0] *= np.sqrt(5)
    sigma[n_base] *= np.sqrt(1 + 5 * (4 / 3) ** 2)
    sigma[n_base + 1] *= np.sqrt(5)
    correlation = np.corrcoef(values[:, 0], values[:, n_base])[0, 1]
    assert correlation == pytest.approx(-1 / np.sqrt(1 + 9 / 80), abs=0.02)
    np.testing.assert_allclose(values.std(axis=0), sigma, rtol=4 * 0.035)
    assert (np.abs(values.mean(axis=0) - truth) < 4.5 * sigma / np.sqrt(COUNT)).all()


def test_thin_links_are_drawn_as_stated_where_the_log_favours_it(
    lib: Library, monitored: Monitored
) -> None:
    """Oracle: the bodies, of the Wishart law about the URDF, or about its thickened links.

    The data know β to a hundredth of the prior. Link 5 has 0.038 % of Σ_com in its thin axis.
    """
    known, rng = monitored.posterior.information, np.random.default_rng(3)
    n_base = len(lib.base_matrix)
    prior = lib.base_matrix @ block_diag(*bodies_of(lib).spread(known.centre))
    factor = np.eye(len(known.statistics.factor))
    factor[:n_base, :n_base] = 100 * np.linalg.cholesky(np.linalg.inv(prior @ prior.T)).T
    for centre in (lib.pi0, known.centre):
        root = np.linalg.cholesky(lib.pseudo_inertia(centre) / (2 * known.kappa))
        normal = root @ rng.normal(size=(lib.n_links, 4, int(2 * known.kappa) + 5))
        pi = pi_from_pseudo(lib, normal @ np.swapaxes(normal, 1, 2))
        target = factor @ np.concatenate([lib.base_matrix @ pi, monitored.saved.phi.ravel()])
        statistics = dataclasses.replace(known.statistics, factor=factor, target=target)
        information = dataclasses.replace(known, statistics=statistics, density=1.0)
        seen = dataclasses.replace(monitored.posterior, information=information)
        raised = draw_models(lib, monitored.saved, seen, 2, rng).thickened
        if centre is lib.pi0:
            np.testing.assert_allclose(raised, 1.0, rtol=1e-9)
        else:
            assert raised[4] == pytest.approx(0.05 / 0.00038, rel=0.02)


def test_files_are_those_of_the_draws(
    command: Command, monitored: Monitored, tmp_path: Path
) -> None:
    """Oracle: MuJoCo and Pinocchio read masses, dampings and armatures of samples.npz."""
    import mujoco
    import pinocchio

    words = (
        "sample",
        monitored.folder,
        "--count",
        3,
        "--to",
        "mjcf,urdf",
        "--settings",
        f"seed={4}",
    )
    ran = command(*words, "--out", "a")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "a" / "samples.json").read_text())
    arrays = np.load(tmp_path / "a" / "samples.npz")
    assert facts["files"]["mjcf"] == ["model_0001.xml", "model_0002.xml", "model_0003.xml"]
    assert "1000 random states" in facts["checks"]["mjcf"]
    for k in range(3):
        model = mujoco.MjModel.from_xml_path(str(tmp_path / "a" / facts["files"]["mjcf"][k]))
        right = mass(links(arrays["pi"][k])).sum()
        moving = sum(model.body(name).mass[0] for name in facts["links"])
        assert moving == pytest.approx(right, rel=1e-9)
        np.testing.assert_allclose(model.dof_damping, arrays["phi"][k][:, 0], rtol=1e-12)
        urdf = pinocchio.buildModelFromUrdf(str(tmp_path / "a" / facts["files"]["urdf"][k]))
        assert sum(i.mass for i in urdf.inertias[1:]) == pytest.approx(right, rel=1e-9)
    factor = np.array(facts["factors"]["mass"])
    np.testing.assert_allclose(
        factor * mass(links(monitored.saved.pi)), mass(arrays["pi"].reshape(3, 7, 10)), rtol=1e-12
    )
    assert command(*words, "--out", "b").code == 0
    same = [(tmp_path / folder / "model_0002.xml").read_bytes() for folder in "ab"]
    assert same[0] == same[1]


@pytest.mark.parametrize("words", [("--count", 0), ("--to", "friction"), ("--to", "stl")])
def test_bad_options(words: tuple[object, ...], command: Command, monitored: Monitored) -> None:
    """Property: exit code 2 and one sentence."""
    ran = command("sample", monitored.folder, *words)
    assert ran.code == 2
    assert words[0] in ran.err


def test_a_draw_of_no_model_is_refused(lib: Library, monitored: Monitored) -> None:
    """Property: one sentence for a count below one."""
    with pytest.raises(IdentificationError, match="one model or more, got 0"):
        draw_models(lib, monitored.saved, monitored.posterior, 0, np.random.default_rng(0))
