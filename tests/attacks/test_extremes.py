"""Extreme files and options: refused in one sentence, within seconds, without a traceback."""

import json
import re
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from runtime import write_recording
from runtime.common.files import json_of, toml_of
from symgen.chain import read_chain
from symgen.errors import BuildError, UrdfError
from symgen.make.config import read_config
from tests.conftest import TINY_URDF
from tests.runtime.conftest import Command
from tests.runtime.desk import Desk

LONG_KEYS = {
    "dots": "a" + ".a" * 50_000 + " = 1",
    "quoted dots": "'a'" + ".'a'" * 5_000 + " = 1",
    "spaced dots": "a" + " . a" * 5_000 + " = 1",
    "table": "[" + "a." * 50_000 + "a]",
    "long name": "a" * 100_000 + " = 1",
    "after a text": 'x = "# \\" \'"\n' + "a." * 500 + "a = 1",
}


@pytest.mark.parametrize("kind", LONG_KEYS)
def test_long_keys_are_refused_before_they_are_read(kind: str, tmp_path: Path) -> None:
    """Property: 50,000 dots took 51 s and 5.7 GB; now a tenth of a second suffices for them."""
    path = tmp_path / "a.toml"
    path.write_text(LONG_KEYS[kind])
    start = time.process_time()
    with pytest.raises(ValueError, match="a key "):
        toml_of(path)
    with pytest.raises(BuildError, match="a key "):
        read_config(path)
    assert time.process_time() - start < 2.0  # s; twenty times what it takes here


SLOW_TEXTS = {
    "escaped quotes": ("toml", '\\"' * 40_000),
    "open text": ("toml", '"""a ' * 5_001 + '\\"' * 20_000),
    "long": ("toml", "a = [" + "[], " * 2**20 + "]"),
    "lists": ("json", "[" + "[], " * 2**22 + "[]]"),
    "key twice": ("json", "{" + "".join(f'"{k}": 0, ' for k in range(100_000)) + '"99999": 0}'),
    "depth": ("json", "[" * 10**6),
    "depth of a list": ("toml", "a = " + "[" * 10**6),
    "depth of a table": ("toml", "a = " + "{a = " * 10**6),
}


@pytest.mark.parametrize("kind", SLOW_TEXTS)
def test_slow_texts_are_refused(kind: str, tmp_path: Path) -> None:
    """Property: 80 kB of quotes took 42 s, a key that stands twice minutes; now 0.1 s."""
    suffix, text = SLOW_TEXTS[kind]
    path = tmp_path / f"a.{suffix}"
    path.write_text(text)
    start = time.process_time()
    with pytest.raises(ValueError, match=r"."):
        (toml_of if suffix == "toml" else json_of)(path)
    if suffix == "toml":
        with pytest.raises(BuildError):
            read_config(path)
    assert time.process_time() - start < 2.0  # s; the longest takes 0.4 s


def test_usual_keys_are_read(tmp_path: Path) -> None:
    """Property: dots within texts, comments and numbers are no keys."""
    path = tmp_path / "a.toml"
    dots = "." * 100
    path.write_text(
        f'a.b.c = "{dots}"  # {dots}\nd = [{", ".join(["1.5"] * 100)}]\n"e.f" = \'{dots}\''
    )
    assert toml_of(path) == {"a": {"b": {"c": dots}}, "d": [1.5] * 100, "e.f": dots}


LONG = "x" * 5000
IDENTIFY = {
    "cut-off": (("good.csv", "--cutoff", "1e-308"), "--cutoff expects a number from"),
    "small cut-off": (("good.csv", "--cutoff", "1e-10"), "cutoff_hz expects a number from"),
    "slow cut-off": (("good.csv", "--cutoff", "1e-6"), "cutoff_hz expects at least"),
    "rate": (("good.csv", "--settings", "rate=1e-308"), "expects a number from"),
    "name of the log": ((LONG,), "cannot use 'xxx.*File name too long"),
    "name of the recipe": (("good.csv", "--recipe", LONG), "File name too long|no recipe"),
}


@pytest.mark.parametrize("case", IDENTIFY)
def test_identify(case: str, desk: Desk, command: Command) -> None:
    """Property: exit 2 and one sentence."""
    words, message = IDENTIFY[case]
    ran = command(*desk.identify(*words))
    assert ran.code == 2
    assert len(ran.err.splitlines()) == 1
    assert re.search(message, ran.err), ran.err


@pytest.mark.parametrize(
    "words",
    [
        ("--duration", "1e-308"),
        ("--settings", f"harmonics={'1' + '0' * 23}"),
        ("--settings", "harmonics=100000"),
    ],
    ids=str,
)
def test_excite(words: tuple[str, ...], desk: Desk, command: Command) -> None:
    """Property: a motion has a duration and a number of harmonics that a computer can hold."""
    ran = command(*desk.excite(*words))
    assert ran.code == 2
    assert re.search("a trajectory needs|--duration expects a number from", ran.err)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--noise", "1e-308"), "--noise expects a number from 1e-12 to 1e"),
        (("--noise", "1,1,1,1e308,1,1,1"), "--noise expects a number from 1e-12 to 1e"),
        (
            ("--settings", "log_rate=1e308"),
            "the setting log_rate expects a number from 1e-12 to 1e",
        ),
        (("--box=-1e308,1,0,1,0,1",), "--box expects a number from 1e-12 to 1e"),
        (("--carry", "1,1e200,0,0"), "--carry expects a number from 1e-12 to 1e"),
        (("--table", "inf"), "--table expects a number from 1e-12 to 1e"),
        (("--speed", "1e-7"), "--speed 1e-07 makes the motion of 10 s long"),
    ],
    ids=str,
)
def test_numbers_of_options(
    words: tuple[str, ...], message: str, desk: Desk, command: Command
) -> None:
    """Property: sizes that overflow when squared are refused, in every option and at once."""
    ran = command(*desk.excite(*words))
    assert ran.code == 2
    assert message.replace("of 10 s long", "of 10 s 1e+10 s long") in ran.err
    assert len(ran.err.splitlines()) == 1


@pytest.mark.parametrize("name", ["excite", "identify", "simulate"])
def test_seeds_have_64_bits(name: str, desk: Desk, command: Command) -> None:
    """Property: a seed that result.json cannot hold is refused before anything is computed."""
    words = {"excite": desk.excite(), "simulate": desk.simulate()}.get(
        name, desk.identify("good.csv")
    )
    ran = command(*words, "--settings", f"seed={'9' * 23}")
    assert ran.code == 2
    assert not (desk.folder / "out").exists()


def test_logs_without_samples(desk: Desk, command: Command) -> None:
    """Property: an NPZ of empty arrays, and a clock that is 1e12 too fast."""
    arrays = {"t": np.zeros(0), "q": np.zeros((0, 7)), "tau": np.zeros((0, 7))}
    np.savez(desk.folder / "empty.npz", **arrays)
    np.savez(desk.folder / "nothing.npz")
    with np.load(desk.folder / "good.npz") as good:
        np.savez(desk.folder / "fast.npz", **dict(good) | {"t": good["t"] * 1e-12})
    for name in ("empty", "nothing", "fast"):
        for verb in ("identify", "inspect", "predict"):
            ran = command(verb, f"{name}.npz", "--robot", desk.lib.folder)
            assert ran.code == 2, (verb, name)
            assert len(ran.err.splitlines()) == 1
    assert "expected time in s, up to 1e+12 s in steps from 1e-12 s" in ran.err


def test_torque_of_no_size(desk: Desk, command: Command) -> None:
    """Property: torque of 1e-12 N·m is none that a sensor measures."""
    assert desk.log.tau is not None
    log = desk.changed(tau=1e-14 * desk.log.tau)
    for words in (desk.identify(log), ("predict", log, "--robot", desk.lib.folder)):
        ran = command(*words)
        assert ran.code == 2
        assert re.search(r"torque of the recording 'bad' is at most .* N·m; log the", ran.err)


def test_axes_and_chains() -> None:
    """Property: an axis whose square overflows, and a chain that no computer writes out."""
    with pytest.raises(UrdfError, match=r"'swing' has an axis of length 1e\+200, expected about 1"):
        read_chain(TINY_URDF.replace('xyz="0 1 0"', 'xyz="0 1e200 0"'))
    body = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    links = "".join(f'<link name="l{k}">{body}</inertial></link>' for k in range(102))
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/>'
        f'<child link="l{k + 1}"/></joint>'
        for k in range(101)
    )
    many = "".join(f'<link name="l{k}"/>' for k in range(501))
    with pytest.raises(UrdfError, match="at most 500 links, got 501"):
        read_chain(f'<robot name="wide">{many}</robot>')
    with pytest.raises(UrdfError, match="at most 100 moving joints, got 101"):
        read_chain(f'<robot name="long">{links}{joints}</robot>')


METHODS = ["map", "ols", "wls", "pc-ols", "lm", "iv", "ekf", "log-cholesky"]
COLUMNS = ["viscous", "coulomb", "offset", "load", "rotor", "stribeck"]
OPTIONS = {
    "--split": st.sampled_from(["0.6,0.8", "0.4,0.5", "0.1,0.9"]),
    "--cutoff": st.floats(1.0, 45.0).map(repr),
    "--settings=rate": st.floats(20.0, 100.0).map(repr),
    "--settings=regressor": st.sampled_from(["acceleration", "momentum", "energy"]),
    "--settings=seed": st.integers(0, 2**63 - 1).map(str),
    "--settings=coulomb_speed": st.floats(1e-9, 1e9).map(repr),
}


@pytest.fixture
def logs(desk: Desk) -> tuple[str, ...]:
    """The good log; large and small torque; a joint at rest; one motion without noise."""
    log = desk.log
    assert log.tau is not None
    still = log.q.copy()
    still[:, 2] = 0.3
    others = {
        "large": log.replace(tau=1e5 * log.tau),
        "small": log.replace(tau=1e-5 * log.tau),
        "still": log.replace(q=still, dq=None, ddq=None),
        "exact": log.replace(tau=desk.lib.torque(log.q, log.dq, log.ddq, desk.lib.lam0)),
    }
    for name, other in others.items():
        write_recording(other, desk.folder / f"{name}.csv")
    return ("good.csv", *(f"{name}.csv" for name in others))


@pytest.mark.parametrize("regressor", ["momentum", "energy"])
def test_results_of_other_equations_are_read_again(
    regressor: str, desk: Desk, command: Command
) -> None:
    """Property: the power of all joints is one equation per sample, with one weight."""
    ran = command(*desk.identify("good.csv", "--settings", f"regressor={regressor}"))
    assert ran.code == 0, ran.err
    read = command("evaluate", "out", "good.csv", "--robot", desk.lib.folder)
    assert read.code == 0, read.err


def test_statistics_without_an_uncertainty_are_refused_first(desk: Desk, command: Command) -> None:
    """Property: the result was written before the option that it cannot serve was refused."""
    words = ("--settings", "certify=false", "--settings", "save_statistics=true")
    ran = command(*desk.identify("good.csv", *words))
    assert ran.code == 2
    assert "save_statistics needs the uncertainty, which certify=false leaves out" in ran.err
    assert not (desk.folder / "out").exists()


@settings(max_examples=16, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_what_identify_writes_evaluate_reads(
    data: st.DataObject, desk: Desk, logs: tuple[str, ...], command: Command
) -> None:
    """Property: over random options and logs, a result that was written is read again."""
    log = data.draw(st.sampled_from(logs))
    words = ["--method", data.draw(st.sampled_from(METHODS))]
    columns = data.draw(st.lists(st.sampled_from(COLUMNS), unique=True))
    words += ["--friction", ",".join(columns)] if columns else []
    for option, values in OPTIONS.items():
        words += [f"{option}={data.draw(values)}"] if data.draw(st.booleans()) else []
    (desk.folder / "out" / "result.json").unlink(missing_ok=True)
    with pytest.MonkeyPatch.context() as patch:  # the page takes most of the time
        patch.setattr("runtime.outputs.report.report.write_report", lambda folder: folder)
        ran = command(*desk.identify(log, *words), "--overwrite")
    assert ran.code in {0, 2}, ran.err
    written = desk.folder / "out" / "result.json"
    assert written.exists() == (ran.code == 0)
    if ran.code == 2:
        assert len(ran.err.splitlines()) == 1
    else:
        assert json.loads(written.read_text())["format"] == 3
        read = command("evaluate", "out", log, "--robot", desk.lib.folder)
        assert read.code == 0, read.err
