"""Gains of motor currents from one log: ratios, common factor, weighed masses, commands."""

import json
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import IdentificationError
from runtime.estimators.convex.entropic_prior import CAD, bodies_of, prior_of
from runtime.identification.current_gains import Weighed, current_gains, of_gain_one
from runtime.identification.identify import identify
from runtime.identification.result_file import record_of
from runtime.identification.settings import Settings
from runtime.identification.single_log import identify_recording
from runtime.inspection import inspect_log
from runtime.library import Array, Library
from runtime.library.parameters import links, mass
from runtime.recording import Friction, Preparation, read_recording
from runtime.recording.current_gains import UNSEEN, UP_TO_FACTOR
from runtime.recording.streamed import open_streamed
from runtime.recording.unit_conversion import scaled

PREPARATION = Preparation(filter="butterworth", cutoff_hz=10.0, trim_s=0.3)
RECIPE = """[time]
column = "t"
unit = "s"
key = "t"
layout = "npz"
[position]
unit = "rad"
layout = "npz"
key = "q"
[velocity]
unit = "rad/s"
layout = "npz"
key = "dq"
[torque]
unit = "A"
layout = "npz"
key = "i"
[preparation]
filter = "butterworth"
cutoff_hz = 10.0
trim_s = 0.3
"""


def arm_in_currents(
    lib: Library, seed: int, seconds: float = 20.0
) -> tuple[Recording, Array, Array]:
    """Recording with currents, true gains and true π, whose links are drawn from the prior."""
    rng, n = np.random.default_rng(seed), lib.n_joints
    t = np.arange(0, seconds, 0.01)
    size, rate, phase = (
        rng.uniform(low, high, size=(3, n)) for low, high in ((0.1, 0.35), (0.5, 3.0), (0.0, 6.0))
    )
    home = np.array([0.0, -0.6, 0.0, -1.8, 0.0, 1.6, 0.7])
    angle = rate[:, None] * t[None, :, None] + phase[:, None]
    q = home + np.sum(size[:, None] * np.sin(angle), axis=0)
    dq = np.sum((size * rate)[:, None] * np.cos(angle), axis=0)
    ddq = -np.sum((size * rate**2)[:, None] * np.sin(angle), axis=0)
    spread = bodies_of(lib).spread(prior_of(lib, lib.pi0).centre) / np.sqrt(CAD)
    drawn = rng.normal(size=spread.shape[:2])
    pi = lib.pi0 + np.einsum("kij,kj->ki", spread, drawn).ravel()
    phi = rng.uniform([1, 1, -0.3, 0.1], [4, 4, 0.3, 0.6], size=(n, 4))
    tau = lib.inverse_dynamics(q, dq, ddq, pi) + phi[:, 0] * dq + phi[:, 1] * np.tanh(dq / 0.05)
    tau += phi[:, 2] + phi[:, 3] * ddq + 0.3 * rng.normal(size=q.shape)
    gains = rng.uniform(4, 16, size=n) * np.where(np.arange(n) == 3, -1, 1)
    return Recording(t=t, q=q, dq=dq, ddq=ddq, tau=tau / gains), gains, pi


def test_ratios_are_determined_and_the_factor_is_that_of_the_urdf(lib: Library) -> None:
    """Property: errors within 3 σ of what is stated, over two robots drawn from the prior.

    Ratios are of a few percent, the common factor of 9 %, and less with the total mass; a reversed
    current has a negative gain. The last joint carries little.
    """
    for seed in range(2):
        currents, true, pi = arm_in_currents(lib, seed)
        by_urdf = current_gains(currents, lib, preparation=PREPARATION)
        weighed = current_gains(
            currents, lib, [Weighed(float(mass(links(pi)).sum()))], preparation=PREPARATION
        )
        for gains in (by_urdf, weighed):
            r = gains.reference
            seen = np.isfinite(gains.sigma)
            assert seen[:4].all()
            assert (np.abs(gains.gain - true)[seen] < 3 * gains.sigma[seen]).all()
            ratio = gains.gain / gains.gain[r] / (true / true[r]) - 1
            assert (np.abs(ratio)[seen] < 3 * gains.ratio_sigma[seen] + 1e-12).all()
            assert np.sort(gains.ratio_sigma[:4])[1] < 0.05
            assert gains.verdicts.count(UP_TO_FACTOR) >= 4
        assert by_urdf.gain[3] < 0
        assert 0.05 < by_urdf.common_sigma < 0.15
        assert weighed.common_sigma < 0.8 * by_urdf.common_sigma
        assert "total" not in by_urdf.scale


def test_a_weighed_link_fixes_what_it_is_part_of(lib: Library) -> None:
    """Property: with every link weighed the factor is known better than by the URDF; masses and
    names that do not exist are refused.
    """
    currents, true, pi = arm_in_currents(lib, 1)
    names = [joint.link for joint in lib.manifest.all_joints]
    every = [Weighed(float(m), name) for m, name in zip(mass(links(pi)), names, strict=True)]
    alone = current_gains(currents, lib, preparation=PREPARATION)
    gains = current_gains(currents, lib, every, preparation=PREPARATION)
    assert gains.common_sigma < 0.6 * alone.common_sigma
    assert (np.abs(gains.gain - true)[:4] < 3 * gains.sigma[:4]).all()
    for weighed, message in ((Weighed(1.0, "nothing"), "no moving link"), (Weighed(-1.0), "above")):
        with pytest.raises(IdentificationError, match=message):
            current_gains(currents, lib, [weighed], preparation=PREPARATION)


def written(currents: Recording, folder: Path) -> tuple[Path, Path]:
    """Log and recipe without gains."""
    np.savez(folder / "amps.npz", t=currents.t, q=currents.q, dq=currents.dq, i=currents.tau)
    (folder / "amps.toml").write_text(RECIPE)
    return folder / "amps.npz", folder / "amps.toml"


def test_identify_states_what_is_undetermined(lib: Library, command, tmp_path: Path) -> None:
    """Property: the road inspect, identify, gains, identify with the recipe of gains.

    The error in percent does not depend on the factor: with the gains of the recipe it is the same
    up to the digits in which the recipe has them, 1e-5, and their effect on the prior.
    """
    currents, true, _ = arm_in_currents(lib, 0, seconds=10.0)
    log, recipe = written(currents, tmp_path)
    seen = inspect_log(log, lib, recipe)
    assert any(f.kind == "current_gains" for f in seen.findings)
    assert seen.plan.has_unknown_gains
    words = (str(log), "--robot", lib.folder, "--recipe", str(recipe))
    friction = ("--settings", "friction=offset,viscous,coulomb,rotor")
    ran = command("identify", *words, *friction, "--settings", "refit=false", "--out", "out")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["torque_source"] == "current"
    gains = {each["channel"]: each for each in facts["current_gains"]}
    last = gains[lib.joint_names[-1]]
    assert (last["sigma"] is None) == (last["verdict"] == UNSEEN)
    for name, k in zip(lib.joint_names[:4], true, strict=False):
        assert abs(gains[name]["gain"] - k) < 3 * gains[name]["sigma"]
    assert any("common factor comes from the masses of the URDF" in w for w in facts["warnings"])
    assert "common factor" in (tmp_path / "out" / "report.html").read_text()
    assert facts["torque_error_percent"]["after_overall"] < 5
    ran = command("gains", *words, *friction, "--recipe-out", "known.toml", "--total-mass", "18")
    assert ran.code == 0, ran.err
    assert "determined up to" in ran.out
    known = read_recording(log, tmp_path / "known.toml")
    assert not known.has_unknown_gains
    factors = known.recipe.torque.gain  # type: ignore[union-attr]
    assert np.allclose(known.required("tau"), currents.required("tau") * np.array(factors))


def test_currents_are_never_taken_for_torques(lib: Library, command, tmp_path: Path) -> None:
    """Property: commands that need torques refuse currents with unknown gains in one sentence; the
    same factors are applied to a separate test recording.
    """
    currents, _, _ = arm_in_currents(lib, 0, seconds=8.0)
    log, recipe = written(currents, tmp_path)
    read = read_recording(log, recipe)
    result = identify_recording(
        read, lib, validation=read, test=read, friction=Friction(), certify=False
    )
    assert result.train.gains is result.test.gains is not None
    assert of_gain_one(read).recipe.torque.gain == 1.0  # type: ignore[union-attr]
    assert scaled(result.train, result.train.gains) is result.train
    for words in (("--payload", "1,0,0,0"), ("--settings", "loaded_run=2")):
        ran = command("gains", str(log), "--robot", lib.folder, *words)
        assert ran.code == 2, words
        assert len(ran.err.splitlines()) == 1


def test_gains_of_a_streamed_log_and_of_several(lib: Library, tmp_path: Path) -> None:
    """Property: the gains are those of the first rows, or of the first log, and serve all rows."""
    currents, _, _ = arm_in_currents(lib, 0, seconds=10.0)
    path, recipe = written(currents, tmp_path)
    settings = Settings(cutoff=10.0, friction="offset,viscous,coulomb,rotor", refit=False)
    whole = identify(read_recording(path, recipe), lib, settings)
    for result in (
        identify(open_streamed(path, recipe), lib, settings),
        identify([read_recording(path, recipe) for _ in range(2)], lib, settings),
    ):
        assert result.train.gains is not None
        assert whole.train.gains is not None
        # The same rows before the test part, to the last digit.
        assert np.array_equal(result.train.gains.gain, whole.train.gains.gain)
        assert any("common factor comes from" in w for w in record_of(result, "").warnings)
        # The rows of the training differ by their edges alone.
        np.testing.assert_allclose(result.beta, whole.beta, atol=0.02 * np.abs(whole.beta).max())
