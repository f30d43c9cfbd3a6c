"""Torque of a control law: the equation, its recipe, bare NPZ files, and logs read in blocks."""

from pathlib import Path

import numpy as np
import pytest

from runtime.errors import RecordingError
from runtime.recording import read_recording
from runtime.recording.reader import plan_of
from runtime.recording.recipes.recipe_file import load_recipe, recipe_from_table, recipe_text
from runtime.recording.streamed import open_streamed

N, JOINTS = 240, 3
LAW = '[torque]\nlaw = "pd"\nkp = [80, 120, 60]\nkd = [2.5, 2.0, 1.0]\n'


def signals() -> dict[str, np.ndarray]:
    """A log of three joints that measures no torque."""
    rng = np.random.default_rng(0)
    t = np.arange(N) / 200
    q = np.cumsum(rng.normal(scale=1e-3, size=(N, JOINTS)), axis=0)
    dq, q_des = rng.normal(size=(2, N, JOINTS))
    return {
        **{"t": t, "q": q, "dq": dq, "q_des": q_des, "dq_des": 0.1 * q_des},
        **{"kp": np.array([80.0, 120.0, 60.0]), "kd": np.array([2.5, 2.0, 1.0])},
    }


def law(s: dict[str, np.ndarray]) -> np.ndarray:
    """The equation of the law, written a second time."""
    return np.stack(
        [
            s["kp"][j] * (s["q_des"][:, j] - s["q"][:, j])
            + s["kd"][j] * (s["dq_des"][:, j] - s["dq"][:, j])
            for j in range(JOINTS)
        ],
        axis=1,
    )


@pytest.mark.parametrize("streamed", [False, True])
def test_a_bare_npz_gives_the_torque_of_its_law(tmp_path: Path, streamed: bool) -> None:
    """Oracle: the closed form, to rounding; whole files and blocks of rows alike."""
    s, path = signals(), tmp_path / "log.npz"
    np.savez(path, **s)  # type: ignore[arg-type]
    log = open_streamed(path).block(0, N) if streamed else read_recording(path)
    assert log.torque_source == "commanded"
    assert log.tau == pytest.approx(law(s), rel=1e-14)
    assert any("commanded, not measured" in sentence for sentence in log.history)


def test_a_measured_torque_is_kept(tmp_path: Path) -> None:
    """Property: an NPZ with tau is read as before, whatever else it holds."""
    s, path = signals(), tmp_path / "log.npz"
    np.savez(path, **s, tau=np.ones((N, JOINTS)))  # type: ignore[arg-type]
    log = read_recording(path)
    assert log.torque_source == "measured"
    assert (log.required("tau") == 1.0).all()


def test_a_recipe_of_columns_in_degrees(tmp_path: Path) -> None:
    """Oracle: desired positions have unit, sign and order of the measured ones."""
    s, path = signals(), tmp_path / "log.csv"
    order, sign = [2, 0, 1], np.array([1.0, -1.0, 1.0])
    kinds = ("q", "dq", "q_des", "dq_des")
    raw = {key: np.rad2deg(sign * s[key])[:, np.argsort(order)] for key in kinds}
    titles = ["t", *(f"{key}{j}" for key in kinds for j in (1, 2, 3))]
    rows = np.column_stack([s["t"], *(raw[key] for key in kinds)])
    np.savetxt(path, rows, delimiter=",", header=",".join(titles), comments="")
    side = 'order = [2, 0, 1]\nsign = [1, -1, 1]\nunit = "deg'
    text = (
        '[time]\ncolumn = "t"\nunit = "s"\n'
        f'[position]\ncolumns = ["q1", "q2", "q3"]\n{side}"\n'
        f'[velocity]\ncolumns = ["dq1", "dq2", "dq3"]\n{side}/s"\n'
        f'{LAW}q_des = "q_des"\ndq_des = ["dq_des1", "dq_des2", "dq_des3"]\n'
    )
    (tmp_path / "recipe.toml").write_text(text)
    log = read_recording(path, tmp_path / "recipe.toml")
    # Text of 18 digits and two conversions by 180/π, each to 1 ulp of numbers up to 500.
    assert log.tau == pytest.approx(law(s), abs=1e-10)
    again = recipe_text(load_recipe(tmp_path / "recipe.toml"))
    (tmp_path / "again.toml").write_text(again)
    assert load_recipe(tmp_path / "again.toml").law == load_recipe(tmp_path / "recipe.toml").law


def test_limit_feed_forward_and_gear(tmp_path: Path) -> None:
    """Oracle: τ = r clip(kp r e + kd r ė + τ_ff, ± limit), gains by number and by array."""
    s, path = signals(), tmp_path / "log.npz"
    ff = np.full((N, JOINTS), 0.5)
    np.savez(path, **s, ff=ff)  # type: ignore[arg-type]
    (tmp_path / "r.toml").write_text(
        '[torque]\nlaw = "pd"\nkp = "kp"\nkd = 2.0\nq_des = "q_des"\ntau_ff = "ff"\n'
        "effort_limit = [3, 4, 5]\ngear = 6\n"
    )
    motor = s["kp"] * 6 * (s["q_des"] - s["q"]) + 2.0 * 6 * (0.0 - s["dq"]) + ff
    expected = 6 * np.clip(motor, [-3, -4, -5], [3, 4, 5])
    assert read_recording(path, tmp_path / "r.toml").tau == pytest.approx(expected, rel=1e-14)
    assert plan_of(path, tmp_path / "r.toml").torque_source == "commanded"


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({"law": "pid", "kp": 1.0, "kd": 1.0, "q_des": "a"}, "expects one of pd"),
        ({"law": "pd", "kp": -1.0, "kd": 1.0, "q_des": "a"}, "numbers from 0 on"),
        ({"law": "pd", "kp": 1.0, "kd": 1.0}, "q_des"),
        (
            {"law": "pd", "kp": True, "kd": 1.0, "q_des": "a"},
            r"\[torque\]: kp expects a number or a text or a list, got True",
        ),
        ({"law": "pd", "kp": 1.0, "kd": 1.0, "q_des": "a", "unit": "A"}, "unknown key 'unit'"),
        ({"law": "pd", "kp": 1.0, "kd": 1.0, "q_des": "a", "gear": 0.0}, "gear"),
    ],
)
def test_a_wrong_law_is_refused(table: dict, expected: str) -> None:
    """Property: one sentence that names the key."""
    with pytest.raises(RecordingError, match=expected):
        recipe_from_table({"torque": table})


def test_wrong_widths_are_refused(tmp_path: Path) -> None:
    """Property: a gain too many and a missing array are one sentence each."""
    path = tmp_path / "log.npz"
    np.savez(path, **{**signals(), "kp": np.ones(4)})  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="kp expects one value or 3, got 4"):
        read_recording(path)
    (tmp_path / "r.toml").write_text(f'{LAW}q_des = "missing"\n')
    with pytest.raises(RecordingError, match="'missing'"):
        read_recording(path, tmp_path / "r.toml")


@pytest.mark.parametrize("suffix", ["pt", "pkl"])
def test_a_pickle_is_refused_with_its_conversion(tmp_path: Path, suffix: str) -> None:
    """Property: no pickle is opened; one sentence has the lines that convert it."""
    path = tmp_path / f"log.{suffix}"
    path.write_bytes(b"cos\nsystem\n(S'exit 3'\ntR.")
    with pytest.raises(
        RecordingError, match=r"never opened; .*torch\.load.*numpy\.savez\('log\.npz'"
    ):
        read_recording(path)


def test_the_driver_of_the_z1_computes_the_same(shared_data: Path) -> None:
    """Oracle: tau_des of the public log, computed in float32 by the driver of the arm."""
    path = shared_data / "data" / "unitree_air" / "z1.npz"
    with np.load(path) as arrays:
        driver = arrays["tau_des"]
    log = read_recording(path)
    # 30 N·m and gains of 120 N·m/rad on angles of 3 rad, each rounded to float32 (6e-8).
    # The first row holds the torque of a state before the log began.
    assert log.required("tau")[1:] == pytest.approx(driver[1:], abs=1e-4)
