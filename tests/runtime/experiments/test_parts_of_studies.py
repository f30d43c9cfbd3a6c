"""What single studies hand on: logs, plants, marks of a plot, files that belong to a study."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from runtime.estimators.regression.samples import Samples
from runtime.experiments.runner import Request, _clear
from runtime.experiments.storage import RESULT, _numbers, _pairs
from runtime.experiments.studies import logs, methods, model, monte_carlo
from runtime.experiments.trials import scorer_of, sinusoidal, stream
from runtime.library import Library


def test_logs_of_the_training_are_repeated(monkeypatch, lib: Library) -> None:
    """Oracle: three roles and two repeats, without payload and with it; RMS of the torque."""
    config = logs.LogsConfig()
    names = ("training", "validation", "test", "repeat 1", "repeat 2")
    assert logs.roles(config) == names
    rng = np.random.default_rng(0)
    signals = SimpleNamespace(**{key: rng.normal(size=(5, 7)) for key in ("q", "dq", "tau")})
    truth = SimpleNamespace(saturated=np.zeros(7), pi=np.zeros(2))
    carried = []

    def record(_lib: Library, motion: str, payload: object, **_: object) -> SimpleNamespace:
        carried.append((motion, payload is not None))
        return SimpleNamespace(recording=signals, truth=truth)

    monkeypatch.setattr(logs, "record", record)
    setup = logs.LogsSetup(lib, config, lib.pi0, {name: name for name in names}, "box")
    rows = logs.STUDY.run(setup, range(10), 1)
    assert carried == [(name, loaded) for loaded in (False, True) for name in names]
    rms = np.sqrt(np.mean(signals.tau**2, axis=0))
    assert [rows[0][f"measured_rms_{k}"] for k in range(1, 8)] == pytest.approx(rms, rel=1e-14)


def test_the_plant_of_the_methods_has_the_noise_of_its_config(monkeypatch, lib: Library) -> None:
    """Oracle: σ_dq = 2π f σ_q; the URDF of the methods is off by 5 % of λ, one draw per entry."""
    config, plants = methods.MethodsConfig(), []
    monkeypatch.setattr(
        methods,
        "closed_loop",
        lambda _lib, _motion, plant, *_, **_words: (
            plants.append(plant) or SimpleNamespace(replace=lambda **_: plant)
        ),
    )
    part = SimpleNamespace(required=lambda _: np.zeros(3))
    assembly = SimpleNamespace(parts=["training", "validation", part])
    given: dict = {}
    monkeypatch.setattr(
        methods, "assemble", lambda *args, **words: given.update(words, train=args[0]) or assembly
    )
    motions = {"duration": np.array(4.0), "coefficients": np.zeros((3, 7, 2))}
    methods.STUDY.prepare(lib, config, motions)
    assert [plant.velocity_noise for plant in plants] == pytest.approx(
        [2 * np.pi * 30.0 * 1e-4] * 2 + [0.0]
    )
    assert given["validation"] is plants[1]
    assert given["test"] is plants[2]
    lam = lib.lam_from_pi(methods.document_robot(lib))
    draws = stream(config.seed, 0, methods.CAD).normal(size=lam.size)
    np.testing.assert_allclose(given["lam0"], lam * (1 + 0.05 * draws), rtol=1e-14)


def test_a_method_without_figures_keeps_its_row(monkeypatch) -> None:
    """Property: a method that fails is a row with its status alone; figures follow where it ran."""
    setup = SimpleNamespace(
        config=SimpleNamespace(methods=("map",)), assembly=None, truth=None, test=None
    )
    monkeypatch.setattr(methods, "_figures", lambda _, figures: {"airm": figures})
    for figures, more in ((None, {}), (0.5, {"airm": 0.5})):
        compared = SimpleNamespace(rows=[SimpleNamespace(status="ended", figures=figures)])
        monkeypatch.setattr(methods, "compare", lambda *_, c=compared, **_words: c)
        (row,) = methods.STUDY.run(setup, range(1), 1)
        assert row == {"case": "plant", "method": "map", "trial": 0, "status": "ended"} | more


def test_the_straight_part_of_the_remainder_has_both_ends() -> None:
    """Oracle: −5 to −2 of the exponents −1 … −7 in quarters: 13 of 25 steps."""
    config = model.ModelConfig()
    inside = model._straight(config, np.logspace(*config.steps))
    assert inside.sum() == 13
    assert inside[[4, 16]].all()  # 10^-2 and 10^-5


def test_sines_last_as_long_as_the_design(lib: Library) -> None:
    """Oracle: 101 samples at 100 Hz are 1 s; the amplitude grows with the share."""
    still = np.tile(lib.home, (101, 1))
    samples = Samples(still, 0 * still, 0 * still, 0 * still, np.zeros((101, lib.n_joints, 0)))
    setup = SimpleNamespace(train={"designed": samples}, lam=lib.lam0)
    config = SimpleNamespace(rate_hz=100.0, sinusoid=(0.5, 0))
    assert monte_carlo._sines(lib, config, setup).t[-1] == pytest.approx(1.0)
    half, whole = (sinusoidal(lib, 1.0, 100.0, share, 0)[1] for share in (0.5, 1.0))
    np.testing.assert_allclose(half, whole / 2, rtol=1e-14)


def test_friction_is_added_to_the_torque_of_a_result(lib: Library) -> None:
    """Oracle: torque of the rigid body plus friction, so that the true parameters have no error."""
    q, dq, ddq = np.random.default_rng(1).normal(size=(3, 20, lib.n_joints))
    friction = 0.3 * np.sign(dq)
    tau = lib.inverse_dynamics(q, dq, ddq, lib.pi0) + friction
    test = Samples(q, dq, ddq, tau, np.zeros((20, lib.n_joints, 0)))
    scorer = scorer_of(lib, test, None, 3)
    assert scorer.row(lib.pi0, friction)["tau_error"] < 1e-12
    assert scorer.row(lib.pi0)["tau_error"] > 1.0


def test_numbers_of_the_document_have_a_deviation_or_none() -> None:
    """Oracle: a number, a pair, and one of both per joint."""
    assert _pairs("x", 1.0) == [("x", 1.0, None)]
    assert _pairs("x", [1.0, 2.0]) == [("x", 1.0, 2.0)]
    assert _pairs("x", [[1.0, 2.0], [3.0]]) == [("x_1", 1.0, 2.0), ("x_2", 3.0, None)]


def test_files_of_a_study(tmp_path: Path) -> None:
    """Property: numbers stand in the names of chunks; --fresh removes a study's files alone."""
    assert _numbers(Path("00003-00024.parquet")) == range(3, 25)
    assert [*_numbers(Path("3-x.parquet")), *_numbers(Path("x-3.parquet"))] == []
    (tmp_path / "chunks").mkdir()
    for name in ("mine.txt", RESULT, "chunks/00000-00001.parquet"):
        (tmp_path / name).write_text("")
    _clear(tmp_path)
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["chunks", "mine.txt"]
    assert not Request(tmp_path).fresh  # a second run keeps what is finished
