"""The default method, its uncertainty and its further priors; oracles are the truth and numpy."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from runtime import read_recording
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, GRIPPER, bodies_of, prior_of, spread_of
from runtime.estimators.convex.map_estimate import fit_map
from runtime.estimators.convex.newton import Constraints, convex_problem, minimise
from runtime.estimators.descent.fit import fit_levenberg
from runtime.estimators.prior_file import PriorFile, read_prior
from runtime.estimators.problem import Problem
from runtime.estimators.regression.factor import reduce
from runtime.estimators.regression.samples import (
    Samples,
    autocorrelation,
    inflation,
    noise,
    residuals,
    samples_of,
    thesis_weights,
)
from runtime.estimators.uncertainty import uncertainty_of
from runtime.identification.metrics import torque_error
from runtime.identification.result_file import record_of
from runtime.identification.single_log import identify_recording
from runtime.recording import Friction
from scripts.bench.trials import map_trials


@pytest.fixture(scope="module")
def estimated(lib, noisy):
    """The default method on 0.05 N·m of white noise with friction."""
    return identify_recording(noisy, lib, friction=Friction(("viscous", "coulomb"), 0.03))


def test_the_default_finds_what_made_the_data(lib, noisy, estimated, pi_true):
    """Oracle: friction 0.5 and 0.3 behind 480 samples; torques of unseen samples; weights 1/σ²."""
    assert estimated.method == "map"
    assert estimated.status.startswith("converged")
    assert estimated.relative_eigenvalues.min() > 0
    # Noise/√480 over columns of size 0.5 and 1, three sigma, doubled for their correlation.
    assert estimated.phi == pytest.approx(np.tile([0.5, 0.3], (7, 1)), abs=0.03)
    # σ of 480 samples: 1/√(2·480) = 3.2 %, squared twice that; three sigma.
    np.testing.assert_allclose(estimated.weights, 400, rtol=0.2)
    error = torque_error(estimated.test.tau, estimated.predict_recording(estimated.test))
    # The noise itself; the model adds √(57/3360) of it.
    np.testing.assert_allclose(error.rms, 0.05, rtol=0.15)
    assert 0 <= estimated.gap < 0.05


def test_exact_torques_are_not_drawn_to_the_prior(lib, ideal_runs, pi_true):
    """Oracle: the true base parameters, as the motion of 10 s determines all of them.

    1e-11 seen, of the rounding of torques; with a variance of one as the least, 4e-7.
    """
    result = identify_recording(ideal_runs[0], lib, friction=Friction(()))
    beta = lib.base_matrix @ pi_true
    assert np.linalg.norm(result.beta - beta) < 1e-9 * np.linalg.norm(beta)


def test_intervals_cover_the_truth(lib, noisy, pi_true):
    """Property: 43 base parameters lie within their bands as often as normal numbers would.

    The URDF's last link is half the true one, which a trust of 16 excludes and one of 4 allows.
    """
    terms, prior = Friction(("viscous", "coulomb"), 0.03), PriorFile(GRIPPER, Constraints())
    estimated = identify_recording(noisy, lib, friction=terms, prior=prior)
    u = estimated.uncertainty
    score = (estimated.beta - lib.base_matrix @ pi_true) / u.beta_sigma
    # 95 % less 3 · √(43 · .05 · .95)/43; measured 93, 86, 95 % on three seeds of the noise.
    assert np.mean(np.abs(score) < 1.96) >= 0.85
    # 1 ± 3/√(2 · 43), and some for the wrong link; measured 1.15.
    assert 0.6 < np.sqrt(np.mean(score**2)) < 1.45
    # White noise, of which 64 unknowns leave some 130 cosines at their frequencies: σ = √(2/130).
    assert u.inflation == pytest.approx(1.0, abs=3 * 0.125)
    assert np.mean(u.white) > 0.85


def test_covariance_is_the_inverse_hessian(lib, noisy):
    """Oracle: (N H / S)⁻¹, H = G + κ S/N B with G and B of the solver's own Hessian G + γ B.

    γ counts noise over 24 lags, S at the frequencies of the motion.
    """
    train = samples_of(noisy, lib)
    p = Problem(lib, train, train, thesis_weights(train.tau), lib.lam0)
    fit = fit_map(p)
    known = {"statistics": fit.statistics, "coloured_noise": fit.coloured_noise}
    u = uncertainty_of(lib, train, fit.pi, fit.phi, first_guess=lib.pi0, **known)
    data, _ = reduce(fit.statistics, 7)
    widened, _ = reduce(u.information.statistics, 7)  # rows over their noise and model error
    ratio = inflation(residuals(lib, train, fit.pi, fit.phi), fit.weights)
    gamma = CAD * data.variance * ratio / len(train)
    estimated = minimise(convex_problem(data, prior_of(lib), gamma), fit.pi)
    # γ is taken a step later
    np.testing.assert_allclose(estimated.pi, fit.pi, rtol=1e-4, atol=1e-6)
    gram, level = data.factor.T @ data.factor / len(train), fit.coloured_noise.density
    curvature = (estimated.hessian() - gram) / gamma
    precision = widened.factor.T @ widened.factor / level + CAD * curvature
    root = u.root[:, :70]  # nuisance torque and the error of the estimate follow
    expected = root.T @ precision @ root
    # Rounding × condition of H, 1e8 in natural units.
    np.testing.assert_allclose(expected, np.eye(70), atol=1e-5)


def test_centre_of_mass_moves_with_its_mass(estimated):
    """Oracle: samples from the covariance, c = (m c)/m of each."""
    u, rng = estimated.uncertainty, np.random.default_rng(0)
    draws = rng.normal(size=(20000, u.root.shape[1]))
    pi = (estimated.pi + 1e-3 * draws @ u.root.T).reshape(-1, 7, 10)
    spread = (pi[:, :, 1:4] / pi[:, :, :1]).std(axis=0) / 1e-3
    # σ of 20000 draws: 0.5 %, three sigma and the curvature of 1/m.
    np.testing.assert_allclose(u.com_sigma(estimated.pi), spread, rtol=0.03)


def test_verdicts_follow_the_base_map(lib, estimated):
    """Property: what no motion shows is unobservable; what the data say ten times is identified."""
    u = estimated.uncertainty
    silent = np.flatnonzero(~lib.base_matrix.any(axis=0))
    assert {k for k, v in enumerate(u.verdicts) if v == "unobservable"} == set(silent)
    assert ((u.share > 0) & (u.share <= 1)).all()
    assert u.verdicts[61] == "identified"  # mX of the last link
    assert (u.share[[k for k, v in enumerate(u.verdicts) if v == "identified"]] < 0.1).all()


def test_bands_cover_unseen_torque(estimated):
    """Property: 95 % of held-out torques lie within 1.96 σ."""
    test = samples_of(estimated.test, estimated.lib)
    rows = slice(None, None, 4)
    band = estimated.uncertainty.torque_band(
        estimated.lib, test.q[rows], test.dq[rows], test.ddq[rows]
    )
    miss = np.abs(test.tau - estimated.predict_recording(estimated.test))[rows] / band
    # 707 samples: σ of the share is 0.8 %; s itself is known to 3 %, which moves it by 1 %.
    assert 0.92 < np.mean(miss < 1.96) < 0.98


def test_correlated_residuals_count_less(lib):
    """Oracle: AR(1) with ρ = 0.8 inflates by (1 + ρ)/(1 − ρ) = 9; white noise by 1."""
    rng = np.random.default_rng(0)
    rest = rng.normal(size=(20000, 3))
    for k in range(1, len(rest)):
        rest[k] += 0.8 * rest[k - 1]
    assert inflation(rest, np.ones(3)) == pytest.approx(9, rel=0.1)
    assert inflation(rng.normal(size=(20000, 3)), np.ones(3)) == pytest.approx(1, abs=0.1)
    assert autocorrelation(rest)[0] == pytest.approx(0.8, abs=0.02)
    assert inflation(np.zeros((50, 3)), np.ones(3)) == 1.0


def test_monte_carlo_of_the_document(lib, trajectories):
    """Oracle: the document's truth; a short form of `scripts/methods_table trials`.

    Of 150 trials the mean AIRM is .150 with a spread of .05 over trials: ± .015 for 12 of them.
    """
    trials = map_trials(lib, trajectories[1], trajectories[0], 12, certify=3)
    assert trials.airm < 0.195
    assert trials.strict == 1.0
    assert trials.gap <= 1e-6
    assert (trials.percent[:6] <= 1.5 * np.array([0.16, 0.03, 0.09, 0.05, 0.35, 0.20])).all()


@pytest.mark.parametrize("cholesky", [False, True])
def test_levenberg_recovers_from_far(lib, cholesky):
    """Oracle: the robot that made clean data, from a start whose torques are 3.6 % off."""
    rng = np.random.default_rng(3)
    q, dq, ddq = rng.normal(size=(3, 400, 7))
    tau = lib.torque(q, dq, ddq, lib.lam0 * (1 + 0.05 * rng.uniform(-1, 1, 70)))
    data = Samples(q, dq, ddq, tau, np.zeros((400, 7, 0)))
    start = lib.lam0 * (1 + 0.15 * rng.uniform(-1, 1, 70))
    far = lib.torque(q, dq, ddq, start)
    assert torque_error(tau, far).overall > 3
    fit = fit_levenberg(Problem(lib, data, data, np.ones(7), start), cholesky)
    # λ's thin axes make the last digits slow; a wrong Jacobian stops above 1 %.
    assert torque_error(tau, lib.inverse_dynamics(q, dq, ddq, fit.pi)).overall < 0.01
    assert lib.relative_eigenvalues(fit.pi).min() > 0


def test_constant_joints_are_advised(lib):
    """Property: one moving joint leaves the rest to the prior, says so, and nothing is NaN."""
    t = np.linspace(0, 4, 200)
    q, dq, ddq = np.tile(lib.home, (200, 1)), np.zeros((200, 7)), np.zeros((200, 7))
    q[:, 1] += 0.3 * np.sin(3 * t)
    dq[:, 1], ddq[:, 1] = 0.9 * np.cos(3 * t), -2.7 * np.sin(3 * t)
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0)
    tau += 0.05 * np.random.default_rng(0).normal(size=tau.shape)
    s = Samples(q, dq, ddq, tau, np.zeros((200, 7, 0)))
    fit = fit_map(Problem(lib, s, s, thesis_weights(tau), lib.lam0))
    u = uncertainty_of(lib, s, fit.pi, fit.phi, first_guess=lib.pi0)
    assert u.rank < 43
    assert "record a motion that moves every joint" in u.advice()
    assert np.isfinite(u.root).all()
    assert np.isfinite(fit.pi).all()
    # What was not excited stays at the prior: masses within its 25 %.
    assert np.abs(fit.pi[::10] / lib.pi0[::10] - 1).max() < 0.25


def test_exact_data_give_finite_answers(lib, ideal_runs):
    """Property: no noise at all, so weights and γ meet their floors; β is the truth's."""
    train, validation, test = ideal_runs
    result = identify_recording(train, lib, validation=validation, test=test)
    error = torque_error(result.test.tau, result.predict_recording(result.test))
    assert error.overall < 1e-3
    assert np.isfinite(result.uncertainty.root).all()
    facts = record_of(result, "").uncertainty
    assert len(facts.links) == 7
    assert facts.advice == result.uncertainty.advice()


def test_real_arm_by_default(lib, panda):
    """Real data: better than the descent, and a mass that the manufacturer would recognise."""
    result = identify_recording(panda, lib)
    error = torque_error(result.test.tau, result.predict_recording(result.test)).overall
    assert error <= 1.45  # measured 1.420; least squares without bodies has 1.305
    assert result.pi[::10].sum() == pytest.approx(lib.pi0[::10].sum(), rel=0.15)
    assert result.uncertainty.inflation > 5
    assert "a torque gain of 1.084" in result.uncertainty.advice()
    assert "at fr3_joint6" in result.uncertainty.advice()


def test_a_hardly_exciting_log_keeps_to_the_prior(robot, shared_data):
    """Real data: run 1 predicts runs 2 and 3 of the same arm (measured 4.5 %), masses stay sane."""
    lib = robot("kuka_lwr4")
    runs = [read_recording("lwr4_flobaroid", None, run) for run in "123"]
    terms = runs[0].recipe.friction
    result = identify_recording(runs[0], lib, validation=runs[1], test=runs[2], friction=terms)
    error = torque_error(result.test.tau, result.predict_recording(result.test)).overall
    assert error <= 8.8
    assert result.pi[::10].sum() == pytest.approx(lib.pi0[::10].sum(), rel=0.15)


PRIOR = """
trust = "gripper"
total_mass = [14.0, 20.0]
[link.fr3_link7]
mass = 1.2
symmetry = ["xz"]
com_box = [[-0.05, -0.05, -0.1], [0.05, 0.05, 0.1]]
[link.fr3_link6]
com_hull = [[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2], [0, -0.1, -0.2]]
"""


def test_further_priors_hold(lib, noisy, tmp_path):
    """Property: what the file says holds in the answer, to rounding or strictly."""
    path = tmp_path / "arm.toml"
    path.write_text(PRIOR)
    prior = read_prior(path, lib)
    assert prior.kappa == 4.0
    result = identify_recording(noisy, lib, prior=prior)
    pi = result.pi.reshape(7, 10)
    assert 14.0 < pi[:, 0].sum() < 20.0
    # Rounding of the null space, whose basis has units of the prior.
    assert pi[6, 0] == pytest.approx(1.2, rel=1e-9)
    np.testing.assert_allclose(pi[6, [2, 7, 9]], 0.0, atol=1e-9)
    assert (np.abs(pi[6, 1:4] / pi[6, 0]) < [0.05, 0.05, 0.1]).all()
    assert result.relative_eigenvalues.min() > 0
    free = identify_recording(noisy, lib).pi.reshape(7, 10)
    assert abs(free[6, 0] - 1.2) > 0.01


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("total_mass = 2\n[link.fr3_link7]\nmass = 3", "total_mass and fr3_link7.mass contradict"),
        (
            "[link.fr3_link6]\nmass = 2\n[link.fr3_link7]\nmass = [3, 4]\n"
            "com_box = [[1, 1, 1], [2, 2, 2]]\ncom_hull = [[0,0,0],[1,0,0],[0,1,0],[0,0,1]]",
            r"^the priors on fr3_link7.*com_box.* contradict each other",
        ),
        ("[link.nose]\nmass = 1", "unknown entry 'link.nose'"),
        ("mass = 1", "unknown key 'mass'; did you mean 'total_mass'"),
        ("[link.fr3_link1]\nmas = 1", "unknown key 'mas' in link.fr3_link1; did you mean 'mass'"),
        ("total_mass = -1", "a mass above 0 kg"),
        ("total_mass = [3, 2]", r"\[lowest, highest\]"),
        ("[link.fr3_link1]\nmass = nan", r"link\.fr3_link1\.mass expects a finite number"),
        ("[link.fr3_link1]\ncom_box = [[0, 0, 0]]", "lowest and highest corner"),
        ("[link.fr3_link1]\ncom_hull = [[0,0,0],[1,0,0],[0,1,0],[1,1,0]]", "not in one plane"),
        ("[link.fr3_link1]\ncom_hull = []", "not in one plane"),
        ("[link.fr3_link1]\nsymmetry = ['ab']", "a list of xy, xz, yz"),
        (
            "trust = 'blind'",
            "trust expects one of cad, gripper, none or a number above 0, got 'blind'",
        ),
        ("total_mass = ", "cannot be read as TOML"),
    ],
)
def test_priors_that_make_no_sense(lib, noisy, tmp_path, text, match):
    """Property: one sentence that names the entry, or those that contradict each other."""
    path = tmp_path / "arm.toml"
    path.write_text(text)
    with pytest.raises(IdentificationError, match=match):
        identify_recording(noisy, lib, prior=read_prior(path, lib))


def test_options_that_do_not_go_together(lib, noisy, tmp_path):
    """Property: a prior for a method that takes none, a missing file, no trust at all."""
    path = tmp_path / "arm.toml"
    path.write_text("total_mass = 16")
    with pytest.raises(IdentificationError, match="used by the method map only"):
        identify_recording(noisy, lib, "ols", prior=read_prior(path, lib))
    with pytest.raises(IdentificationError, match="cannot be read"):
        read_prior(Path("nowhere.toml"), lib)
    with pytest.raises(IdentificationError, match="trust κ above 0"):
        identify_recording(noisy, lib, prior=dataclasses.replace(read_prior(path, lib), kappa=-1.0))


def test_residual_noise_corrects_for_unknowns(lib, noisy, pi_true):
    """Oracle: residuals of the truth are the noise and the friction that was left out."""
    samples = samples_of(noisy, lib)
    rest = residuals(lib, samples, pi_true, np.zeros((7, 0)))
    expected = np.sqrt(np.sum(rest**2, axis=0) / (len(samples) - 43 / 7))
    np.testing.assert_allclose(noise(rest, lib, 0), expected)


@pytest.mark.parametrize("kappa", [0.5, 4.0])
def test_the_curvature_of_the_prior(lib, kappa: float) -> None:
    """Oracle: inverse of XᵀX + κ ∇²(−log det P), whose entries are tr(P⁻¹ B_i P⁻¹ B_j)."""
    bodies = bodies_of(lib)
    rows = np.random.default_rng(0).normal(size=(3, lib.pi0.size))
    wanted = rows.T @ rows
    for k, body in enumerate(bodies.pseudo_inertia(lib.pi0)):
        turned = np.linalg.solve(body, bodies.basis)
        block = slice(10 * k, 10 * k + 10)
        wanted[block, block] += kappa * np.einsum("iab,jba->ij", turned, turned)
    root = spread_of(bodies, lib.pi0, rows, kappa).root
    # In the coordinates of the root, where the condition of the inertias has no part: 5e-11 seen.
    np.testing.assert_allclose(root.T @ wanted @ root, np.eye(len(wanted)), atol=1e-9)
