"""runtime.identify: the document's ideal case, a real arm, and options that make no problem."""

import dataclasses

import numpy as np
import pytest

import runtime
from runtime import METHODS, PRESETS, Identification, Preset, Recording, read_recording
from runtime.errors import IdentificationError, RecordingError
from runtime.estimators.classical.pc_ols import SLACK
from runtime.estimators.descent.fit import CHUNK
from runtime.estimators.optimizers import AdamOptions, StoppingRule
from runtime.identification.metrics import airm, torque_error
from runtime.identification.result_file import record_of
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, Split

Runs = tuple[Recording, ...]


def test_presets_are_the_documents_tables() -> None:
    """Oracle: document Tables 5.1 and 5.8."""
    simulation, real = PRESETS["simulation"], PRESETS["real"]
    assert simulation.adam == AdamOptions(1e-3, 0.9, 0.999, 1e-8)
    assert real.adam == AdamOptions(1e-4, 0.9, 0.999, 1e-8)
    assert (simulation.rule.max_iterations, real.rule.max_iterations) == (1500, 2500)
    assert simulation.batch == real.batch == 64
    for preset in (simulation, real):
        assert (preset.rule.patience, preset.rule.validate_every) == (25, 5)
        assert preset.rule.threshold == 2e-6


@pytest.fixture(scope="module")
def document_case(lib: Library, ideal_runs: Runs, pi_true: np.ndarray) -> list[Identification]:
    """Sec. 5.1.1 with p = 0.05, ten starts."""
    train, validation, test = ideal_runs
    lam = lib.lam_from_pi(pi_true)
    results = []
    for seed in range(10):
        start = lam * (1 + 0.05 * np.random.default_rng(seed).normal(size=lam.size))
        results.append(
            identify_recording(
                train,
                lib,
                preset="simulation",
                validation=validation,
                test=test,
                lam0=start,
                seed=seed,
            )
        )
    return results


def test_document_ideal_case(
    lib: Library, ideal_runs: Runs, pi_true: np.ndarray, document_case: list[Identification]
) -> None:
    """Oracle: the truth behind ideal recordings, to the figures of the document's Table 5.2.

    The document reports a mean AIRM of 0.0288; 0.03 allows for the choice of ten seeds (measured
    here: 0.0235). Every joint's mean torque error stays below 0.5 % (measured: 0.43 at most).
    """
    test = ideal_runs[2]
    rows = np.linspace(0, len(test) - 1, 50).round().astype(int)
    truth = lib.mass_matrix(test.q[rows], pi_true)
    distances = [airm(truth, lib.mass_matrix(test.q[rows], r.pi)).mean() for r in document_case]
    percents = [torque_error(test.tau, r.predict_recording(test)).percent for r in document_case]
    assert np.mean(distances) <= 0.03
    assert np.mean(percents, axis=0).max() <= 0.5
    for result in document_case:
        assert result.is_consistent
        assert result.relative_eigenvalues.min() > 0


def test_document_case_ends_by_patience(document_case: list[Identification]) -> None:
    """Property: all starts converge well below the cap; the gap is against a vanishing optimum."""
    for result in document_case:
        assert result.status.startswith("converged")
        assert 25 < result.iterations < 1500
        assert result.trace.iteration[-1] <= result.iterations
        assert np.isfinite(result.gap)


def test_the_same_seed_gives_the_same_result(
    lib: Library, ideal_runs: Runs, document_case: list[Identification]
) -> None:
    """Property: bit for bit; another seed of the mini-batches gives another path."""
    lam = document_case[0].lib.lam_from_pi(document_case[0].pi)
    train, validation, test = ideal_runs

    def again(seed: int) -> np.ndarray:
        return identify_recording(
            train,
            lib,
            preset=Preset(AdamOptions(1e-3), StoppingRule(40, 40), 64),
            validation=validation,
            test=test,
            lam0=lam * 1.01,
            seed=seed,
        ).pi

    assert np.array_equal(again(3), again(3))
    assert not np.array_equal(again(3), again(4))


def errors(result: Identification) -> tuple[float, float]:
    """Overall torque error before and after, percent."""
    tau = result.test.tau
    before = torque_error(tau, result.before(result.test)).overall
    return before, torque_error(tau, result.predict_recording(result.test)).overall


def test_real_arm_by_the_descent(panda_adam: Identification) -> None:
    """Real data: the document's method on the published Panda log (measured: 4.457 → 1.532 %).

    The stop depends on the rows: validation from 0.47, 0.475 … 0.5 gives 1.47 to 1.55 %.
    """
    before, after = errors(panda_adam)
    assert 4.4 <= before <= 4.5
    assert after <= 1.55
    assert panda_adam.is_consistent
    assert panda_adam.relative_eigenvalues.min() > 0
    # The descent in λ stops a percent above the convex optimum, never below it.
    assert -1e-6 <= panda_adam.gap < 0.05


def test_real_arm_by_least_squares(panda: Recording, lib: Library) -> None:
    """Real data: what other tools call the classical answer (measured: 1.305 %)."""
    result = identify_recording(panda, lib, "ols")
    # ± 0.05: room for another BLAS and a retuned preparation, not for a wrong column.
    assert errors(result)[1] == pytest.approx(1.31, abs=0.05)
    assert result.lam is None


def test_real_arm_by_the_convex_program(panda: Recording, lib: Library) -> None:
    """Real data: consistent and better than the descent (measured: 1.415 %)."""
    result = identify_recording(panda, lib, "pc-ols")
    assert errors(result)[1] <= 1.45
    assert result.is_consistent
    # Its slack, and 5 % of that for lifting links off the boundary of consistency.
    assert 0 <= result.gap <= 1.05 * SLACK


def test_the_convex_program_gives_bodies_one_could_lift(robot, shared_data) -> None:
    """Real data: a hardly exciting log, on which the bare optimum asks for 1400 kg per link."""
    lib = robot("kuka_lwr4")
    result = identify_recording(read_recording("lwr4_flobaroid"), lib, "pc-ols")
    masses, known = (pi.reshape(lib.n_joints, -1)[:, 0] for pi in (result.pi, lib.pi0))
    # The arm weighs 16 kg; without a prior twice that still explains the log.
    assert masses.sum() < 2.5 * known.sum()
    assert result.gap <= 1.05 * SLACK


def test_real_arm_by_the_documents_preset(panda: Recording, lib: Library) -> None:
    """Real data: Table 5.8's small steps improve on the URDF, though by less."""
    result = identify_recording(panda, lib, preset="real")
    before, after = errors(result)
    assert after < 0.6 * before
    assert result.is_consistent


def test_prediction_is_the_model_and_its_friction(panda_adam: Identification) -> None:
    """Oracle: Y π + φ_v dq + φ_c tanh(dq/ε) + φ_0 by hand, one sample and many."""
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 4, 7))
    r = panda_adam
    friction = r.phi[:, 0] * dq + r.phi[:, 1] * np.tanh(dq / 0.02) + r.phi[:, 2]
    expected = r.lib.regressor(q, dq, ddq) @ r.pi + friction
    # Rounding of sums of 70 terms.
    assert r.predict(q, dq, ddq) == pytest.approx(expected, rel=1e-11, abs=1e-11)
    assert r.predict(q[0], dq[0], ddq[0]) == pytest.approx(expected[0], rel=1e-11, abs=1e-11)
    assert r.beta == pytest.approx(r.lib.base_matrix @ r.pi, rel=1e-14)


def test_trials_can_do_without_the_certificate(lib: Library, ideal_runs: Runs) -> None:
    """Property: the same parameters, no optimum, and a gap that says that it is unknown."""
    train, validation, test = ideal_runs
    sure = identify_recording(train, lib, "adam", validation=validation, test=test)
    quick = identify_recording(train, lib, "adam", validation=validation, test=test, certify=False)
    np.testing.assert_array_equal(sure.pi, quick.pi)
    assert np.isnan(quick.gap)
    assert quick.uncertainty is None
    assert record_of(quick, "").gap_to_convex_optimum is None


def test_interruption_keeps_the_best(lib: Library, ideal_runs: Runs) -> None:
    """Property: Ctrl-C inside the descent still gives a result that beats the start."""

    def stop(iteration: int, _: float) -> None:
        if iteration >= 50:
            raise KeyboardInterrupt

    train, validation, test = ideal_runs
    result = identify_recording(train, lib, "adam", validation=validation, test=test, progress=stop)
    assert result.status.startswith("interrupted by the user")
    assert result.iterations == CHUNK
    before, after = errors(result)
    assert after < before


def test_a_split_recording_is_cut_in_order(lib: Library, ideal_runs: Runs) -> None:
    """Property: 48 / 12 / 40 % by default, every sample in one part, for a method that stops by
    the validation part; for another the validation part is the end of the training part.
    """
    result = identify_recording(ideal_runs[0], lib, "lm")
    parts = (result.train, result.validation, result.test)
    assert [len(part) for part in parts] == [480, 120, 401]
    assert np.array_equal(np.concatenate([part.t for part in parts]), ideal_runs[0].t)
    half = identify_recording(ideal_runs[0], lib, "lm", split=Split((0, 0.5), (0.5, 0.9), (0.9, 1)))
    assert [len(p) for p in (half.train, half.validation, half.test)] == [500, 400, 101]
    joined = identify_recording(ideal_runs[0], lib, "ols")
    assert [len(p) for p in (joined.train, joined.test)] == [600, 401]
    assert np.array_equal(joined.train.t[480:], joined.validation.t)


def test_friction_is_identified(lib: Library, noisy: Recording) -> None:
    """Oracle: 0.5 N·m·s/rad and 0.3 N·m behind 0.05 N·m of noise on 480 samples."""
    terms = Friction(("viscous", "coulomb"), 0.03)
    result = identify_recording(noisy, lib, "ols", friction=terms)
    # Noise/√480 over columns of size 0.5 and 1, for seven joints at three sigma: 0.014, doubled
    # for the correlation between them and with the inertial columns.
    assert result.phi == pytest.approx(np.tile([0.5, 0.3], (7, 1)), abs=0.03)


def test_preparation_can_be_given(lib: Library, noisy: Recording) -> None:
    """Property: the requested preparation is the one in the history."""
    result = identify_recording(noisy, lib, "ols", preparation=Preparation(rate_hz=50.0))
    assert result.train.rate_hz == pytest.approx(50.0, rel=1e-9)
    assert any("50 Hz" in step for step in result.train.history)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"method": "magic"}, "no method 'magic'; choose one of map, adam, lm, log-cholesky"),
        ({"preset": "magic"}, "no preset 'magic'; choose one of simulation, real, full"),
        ({"preset": "real", "method": "map"}, "a preset belongs to the method adam"),
        ({"validation": "train"}, "both a validation and a test recording, or neither"),
        ({"test": "train"}, "both a validation and a test recording, or neither"),
    ],
)
def test_bad_options(
    lib: Library, ideal_runs: Runs, options: dict[str, object], match: str
) -> None:
    """Property: each is one sentence that names what would be right."""
    chosen = {k: ideal_runs[0] if v == "train" else v for k, v in options.items()}
    with pytest.raises(IdentificationError, match=match):
        identify_recording(ideal_runs[0], lib, **chosen)


def test_too_few_samples_are_refused(lib: Library, ideal_runs: Runs) -> None:
    """Property: fewer equations than unknowns determine nothing, by whatever method."""
    short = ideal_runs[0].take(slice(0, 12), "cut")
    for method in METHODS:
        # Six rows of training, with the validation part where the method trains on it.
        edges = (0.48, 0.7) if METHODS[method].uses_validation else (0.3, 0.48)
        parts = Split((0, edges[0]), edges, (edges[1], 1))
        with pytest.raises(IdentificationError, match="42 equations for 43 unknowns"):
            identify_recording(short, lib, method, split=parts)


def test_unknown_friction_is_refused(lib: Library, ideal_runs: Runs) -> None:
    """Property: unknown and repeated columns are reported."""
    for names, match in ((("stiction",), "no friction column"), (("offset",) * 2, "twice")):
        with pytest.raises(RecordingError, match=match):
            identify_recording(ideal_runs[0], lib, friction=Friction(names))


def test_the_public_face_has_what_it_names() -> None:
    """Property: every name of runtime.__all__ exists."""
    assert all(hasattr(runtime, name) for name in runtime.__all__)
    assert dataclasses.is_dataclass(Identification)
