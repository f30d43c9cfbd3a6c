"""Methods that need no more of a streamed log than factors and sums."""

import dataclasses
import json

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.estimators.classical.least_squares import variance_of
from runtime.estimators.descent.fit import PRESETS
from runtime.estimators.methods import METHODS, methods_from_statistics
from runtime.estimators.regression.samples import thesis_weights
from runtime.identification import long_logs as blocks
from runtime.identification import long_logs as passes
from runtime.identification import problem_setup
from runtime.identification.identified import torque_errors
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Friction, Preparation, write_recording
from runtime.recording.formats import tables
from runtime.recording.streamed import open_streamed
from tests.runtime.conftest import Command
from tests.runtime.motions import moving

PREPARATION = Preparation(
    filter="butterworth", cutoff_hz=20.0, max_gap_s=6e-3, rate_hz=100.0, rest_speed=0.02
)
FRICTION = Friction()


@pytest.fixture(scope="module")
def log(lib: Library) -> Recording:
    return moving(lib, 12_000, payload=0.1 * lib.pi0)


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blocks, "BLOCK", 2048)
    monkeypatch.setattr(tables.Spool, "SMALL", 2**16)


BARS = {
    "ols": (1e-3, 1e-5),
    "wls": (1e-3, 1e-5),
    "pc-ols": (1e-3, 1e-5),
    "lm": (0.5, 1e-3),
    "log-cholesky": (0.5, 1e-3),
    "adam": (0.4, 0.01),
}
"""Of β in σ, and of the loss. Filters leave 1e-9 of the torque at the edges of blocks, which is a
ten-thousandth of σ with noise of 0.02 N·m and 40 000 equations; descents stop short of the bottom.
Steps of Adam amplify rounding: after 300 to 600 iterations β differs by 0.09 to 0.14 σ. Its own end
is the best of many equal validation losses, which rounding chooses."""
FULL = PRESETS["full"]
SHORT = dataclasses.replace(FULL, rule=dataclasses.replace(FULL.rule, max_iterations=500))


@pytest.mark.parametrize("method", BARS)
def test_answers_are_those_of_the_whole_log(lib, log, tmp_path, monkeypatch, method):
    """Oracle: the parameters, loss, optimum and errors of the whole log, from factors of blocks.

    Windows leave out a third of the training part; the weights that come from them are held alike.
    """
    monkeypatch.setattr(passes, "LENGTH", 200)
    options = {"preparation": PREPARATION, "friction": FRICTION}
    options |= {"preset": SHORT} if method == "adam" else {}
    whole = identify_recording(log, lib, method, **options)
    weights = thesis_weights(whole.train.tau)
    monkeypatch.setattr(problem_setup, "thesis_weights", lambda *_: weights)
    write_recording(log, tmp_path / "x.npz")
    result = identify_recording(open_streamed(tmp_path / "x.npz"), lib, method, **options)
    assert len(result.train) < 0.8 * len(whole.train)
    far, more = BARS[method]
    shift = (result.beta - whole.beta) / whole.uncertainty.beta_sigma
    assert np.abs(shift).max() < far
    assert result.loss == pytest.approx(whole.loss, rel=more)
    assert result.optimum == pytest.approx(whole.optimum, rel=1e-5)
    assert result.uncertainty.n_samples == len(whole.train)
    error, expected = result.streamed.errors[1], torque_errors(whole)[1]
    assert error.overall == pytest.approx(expected.overall, rel=more)
    if method == "wls":
        assert result.notes[0] == whole.notes[0]


def test_variance_of_pieces():
    """Oracle: `numpy.var` of all pieces together, whatever their sizes and means."""
    rng = np.random.default_rng(0)
    pieces = [rng.normal(mean, 1.0, (count, 3)) for mean, count in ((5, 10), (-3, 1), (0, 400))]
    expected = np.concatenate(pieces).var(axis=0)
    np.testing.assert_allclose(variance_of(pieces), expected, rtol=1e-12)


def test_a_block_is_prepared_once(lib, log, tmp_path, monkeypatch):
    """Property: what comes back from the temporary file is what was prepared, in every field."""
    write_recording(log, tmp_path / "x.npz")
    reported = blocks.blocks_of(open_streamed(tmp_path / "x.npz"), lib, PREPARATION, FRICTION)
    first = list(reported.recordings())
    monkeypatch.setattr(blocks, "prepare", None)
    again = list(reported.recordings())
    assert len(first) == len(reported) > 4
    for one, two in zip(first, again, strict=True):
        for field in dataclasses.fields(one):
            a, b = getattr(one, field.name), getattr(two, field.name)
            assert np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b


@pytest.mark.parametrize("method", sorted(set(METHODS) - set(methods_from_statistics())))
def test_methods_that_need_samples_say_so(method):
    """Property: one sentence that names the way out."""
    with pytest.raises(
        IdentificationError, match=f"{method} needs the samples .* --settings stream=false"
    ):
        passes.require_streamable(method)


def test_comparison_of_a_streamed_log(lib, log, tmp_path, command: Command, monkeypatch):
    """Oracle: the table of the whole log, all rows counted, and the sentence for the others."""
    monkeypatch.setattr(passes, "LENGTH", 200)
    write_recording(log, tmp_path / "x.npz")
    words = ("x.npz", "--robot", lib.folder, "--cutoff", "20", "--settings", "rate=100")
    words += ("--friction", "viscous,coulomb,offset")
    facts = []
    for way in ("stream=true", "stream=false"):
        words_of_way = ("--settings", way, "--methods", "map,ols,pc-ols", "--out", way)
        ran = command("compare", *words, *words_of_way)
        assert ran.code == 0, ran.err
        facts.append(json.loads((tmp_path / way / "compare.json").read_text()))
    result, whole = facts
    assert result["recording"]["samples"] == whole["recording"]["samples"]
    assert result["before_percent"] == pytest.approx(whole["before_percent"], rel=1e-6)
    for one, two in zip(result["rows"], whole["rows"], strict=True):
        assert one["method"] == two["method"]
        # First weights are from windows, which leave some rows out.
        for key in ("test_percent", "train_percent"):
            assert one[key] == pytest.approx(two[key], rel=0.01)
        # The noise of windows is known to a tenth; one entry lies that near to its verdict.
        assert one["determined"] == pytest.approx(two["determined"], abs=1)
    assert "streamed 12000 rows" in " ".join(result["notes"])
    ran = command("compare", *words, "--settings", "stream=true", "--methods", "map,nn")
    assert ran.code == 2
    assert "the method nn needs the samples one by one" in ran.err
