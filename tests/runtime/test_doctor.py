"""runtime.doctor: the thirteen traps of real logs are named, clean logs raise no alarm.

The clean log is the bundled simulation (another program made it); each trap is put into it, or
is in a published log or model as it is. What is expected is what was put in.
"""

import copy
import json
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from runtime import Recording, read_recording, write_recording
from runtime.doctor import ERROR, WARNING, Inspection, inspect_log, recipe_text
from runtime.errors import RecordingError
from runtime.library import Library
from runtime.preprocessing import differentiate
from runtime.recording import Friction, load_recipe
from tests.oracle import pinocchio_model

EXAMPLE = Path(__file__).parents[2] / "runtime" / "examples" / "fr3_simulated.npz"


@pytest.fixture(scope="module")
def clean() -> Recording:
    return read_recording(EXAMPLE)


@pytest.fixture
def saved(tmp_path: Path):
    """Writes arrays as the default NPZ; None leaves one out."""

    def save(clean: Recording, name: str = "log.npz", **changes: np.ndarray | None) -> Path:
        arrays = {key: getattr(clean, key) for key in ("t", "q", "dq", "tau")} | changes
        present = {key: values for key, values in arrays.items() if values is not None}
        np.savez(tmp_path / name, **present)
        return tmp_path / name

    return save


def told(inspection: Inspection) -> dict[str, str]:
    """Kinds of warnings and errors → their sentences."""
    return {f.kind: f.sentence for f in inspection.of_level(ERROR, WARNING)}


def trap_of(inspection: Inspection, kind: str) -> int:
    return next(f.trap for f in inspection.findings if f.kind == kind)


def settles(inspection: Inspection, log: Path, lib: Library, tmp_path: Path) -> None:
    """Read with the proposed recipe, the log raises no alarm."""
    recipe = tmp_path / "proposed.toml"
    recipe.write_text(recipe_text(inspection), encoding="utf-8")
    assert told(inspect_log(log, lib, recipe)) == {}


def gravity_of(lib: Library, q: np.ndarray, pi: np.ndarray) -> np.ndarray:
    return lib.inverse_dynamics(q, 0 * q, 0 * q, pi)


# --- no alarm ----------------------------------------------------------------------------------


def test_the_clean_log_is_clean(lib: Library) -> None:
    """Property: nothing to do; one run and joints of little torque are told as information."""
    found = inspect_log(EXAMPLE, lib)
    assert told(found) == {}
    assert {f.kind: f.trap for f in found.findings} == {"one_run": 12, "little_torque": 13}


@pytest.mark.parametrize(
    ("name", "model"),
    [("panda_gaz", "fr3"), ("tx40_figaroh", "tx40"), ("lwr4_flobaroid", "kuka_lwr4")],
)
def test_real_logs_with_their_recipes_are_clean(robot, shared_data: Path, name, model) -> None:
    """Real data: what a bundled recipe settles is no alarm."""
    found = inspect_log(shared_data / "data" / name, robot(model), name)
    assert told(found) == {}


# --- traps -------------------------------------------------------------------------------------


def test_1_a_tool_that_the_model_lacks(lib: Library, clean: Recording, saved) -> None:
    """Property: 0.8 kg at the flange, to the 0.15 kg that links 10 % off feign there."""
    full = differentiate(clean)
    tool = np.array([0.8, 0.02, 0, 0.12, 0.02, 0.02, 0.001, 0, 0, 0])
    Y = lib.regressor(full.q, full.dq, full.ddq)[:, :, -10:]
    found = inspect_log(saved(clean, tau=clean.tau + Y @ tool), lib)
    assert set(told(found)) == {"tool"}
    assert trap_of(found, "tool") == 1
    mass = next(f for f in found.findings if f.kind == "tool").evidence["mass_kg"]
    assert mass == pytest.approx(0.8, abs=0.15)


def test_1_a_hand_that_is_not_mounted(lib: Library, shared_data: Path) -> None:
    """Real data: a Panda without hand against a model with its 0.73 kg."""
    armed = copy.copy(lib)
    hand = np.array([0.73, -0.0073, 0, 0.095, 0.0155, 0.0139, 0.0026, 0, 0, 0])
    armed.pi0 = lib.pi0 + np.concatenate([np.zeros(60), hand])
    found = inspect_log(shared_data / "data" / "panda_gaz", armed, "panda_gaz")
    assert set(told(found)) == {"tool"}
    assert "not mounted" in told(found)["tool"]


def test_2_repeated_rows_and_a_jittering_clock(lib: Library, shared_data: Path) -> None:
    """Real data: 6 % stale rows; the proposed clock is that of the bundled recipe."""
    found = inspect_log(shared_data / "data" / "panda_gaz", lib, bare=True)
    assert set(told(found)) == {"repeated_rows"}
    assert trap_of(found, "repeated_rows") == 2
    assert found.plan.preparation.clock_tick == 1e-3
    assert found.plan.preparation.max_gap_s == 0.02


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6)])
def test_2_time_in_another_unit(lib, clean, saved, tmp_path, unit, factor) -> None:
    """Property: told from dq, and settled by the recipe."""
    log = saved(clean, t=clean.t * factor)
    found = inspect_log(log, lib)
    assert set(told(found)) == {"time_unit"}
    assert found.plan.time.unit == unit
    settles(found, log, lib, tmp_path)


def test_2_irregular_stamps(lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: 8/12 ms steps are jitter; the recipe brings them onto a grid."""
    keep = np.ones(len(clean), dtype=bool)
    t = clean.t + 1e-3 * (np.arange(len(clean)) % 2)
    log = saved(clean, t=t[keep])
    found = inspect_log(log, lib)
    assert set(told(found)) == {"jitter"}
    assert found.plan.preparation.max_gap_s is not None
    settles(found, log, lib, tmp_path)


def test_2_holes_and_dropped_ticks(lib: Library, clean: Recording, saved) -> None:
    """Property: a second is a hole, single rows are ticks; both are counted."""
    keep = np.ones(len(clean), dtype=bool)
    keep[400:500] = False
    keep[[50, 150, 250]] = False
    arrays = {key: getattr(clean, key)[keep] for key in ("t", "q", "dq", "tau")}
    found = inspect_log(saved(clean, **arrays), lib)
    assert {"holes", "dropped_ticks"} <= set(told(found))
    evidence = {f.kind: f.evidence for f in found.findings}
    assert evidence["holes"]["count"] == 1
    assert evidence["holes"]["longest_s"] == pytest.approx(1.01)
    assert evidence["dropped_ticks"]["count"] == 3


def test_2_no_clock_at_all(lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: the rate follows from Δq = dq Δt; without dq it has to be given."""
    log = saved(clean, t=None)
    found = inspect_log(log, lib)
    assert set(told(found)) == {"missing_clock"}
    assert found.plan.time.rate_hz == pytest.approx(100.0, rel=0.02)
    settles(found, log, lib, tmp_path)
    silent = inspect_log(saved(clean, t=None, dq=None), lib)
    assert "--log-rate" in told(silent)["missing_clock"]
    assert "# rate_hz" in recipe_text(silent)
    assert told(inspect_log(saved(clean, t=None, dq=None), lib, rate_hz=100.0)) == {}


def test_2_time_runs_backwards(lib: Library, clean: Recording, saved) -> None:
    """Property: two runs in one file are an error that names the row."""
    t = np.concatenate([clean.t[:500], clean.t[:501]])
    assert "at row 500" in told(inspect_log(saved(clean, t=t), lib))["time_backwards"]


@pytest.mark.parametrize("delay", [0.004, -0.023])
def test_2_torque_is_late(lib: Library, clean: Recording, saved, tmp_path: Path, delay) -> None:
    """Property: a delay of 0.4 and of 2.3 samples, to a tenth of a sample."""
    tau = np.stack([np.interp(clean.t - delay, clean.t, row) for row in clean.tau.T], axis=1)
    log = saved(clean, tau=tau)
    found = inspect_log(log, lib)
    assert set(told(found)) == {"time_shift"}
    assert found.plan.preparation.torque_delay_s == pytest.approx(delay, abs=1e-3)
    settles(found, log, lib, tmp_path)


def test_3_torque_counts_the_other_way(lib, clean, saved, tmp_path) -> None:
    """Property: told as a sign and not as gravity, and proposed, not done."""
    log = saved(clean, tau=-clean.tau)
    found = inspect_log(log, lib)
    assert set(told(found)) == {"torque_sign"}
    assert trap_of(found, "torque_sign") == 3
    assert found.plan.torque.sign == -1.0
    settles(found, log, lib, tmp_path)


def test_3_one_joint_counts_the_other_way(lib, clean, saved, tmp_path) -> None:
    """Property: the joint is named."""
    sign = np.array([1.0, 1, 1, -1, 1, 1, 1])
    log = saved(clean, tau=clean.tau * sign)
    found = inspect_log(log, lib)
    assert set(told(found)) == {"torque_sign"}
    assert "fr3_joint4" in told(found)["torque_sign"]
    assert found.plan.torque.sign == tuple(sign)
    settles(found, log, lib, tmp_path)


def test_3_velocity_of_one_joint_is_turned(lib, clean, saved, tmp_path) -> None:
    """Property: dq against the derivative of q."""
    sign = np.array([1.0, 1, -1, 1, 1, 1, 1])
    log = saved(clean, dq=clean.dq * sign)
    found = inspect_log(log, lib)
    assert set(told(found)) == {"velocity_sign"}
    settles(found, log, lib, tmp_path)


def test_4_a_torque_that_no_sensor_has_measured(lib: Library, clean: Recording, saved) -> None:
    """Property: the model's own output, friction included, is too good to be true."""
    full = differentiate(clean.replace(dq=None))
    pi = lib.pi0 * 1.05
    tau = lib.inverse_dynamics(full.q, full.dq, full.ddq, pi) + 0.5 * full.dq
    found = inspect_log(saved(clean, dq=None, tau=tau), lib)
    assert set(told(found)) == {"not_measured"}
    assert trap_of(found, "not_measured") == 4


def test_4_a_name_that_says_command(lib: Library, clean: Recording, tmp_path: Path) -> None:
    """Property: `tau_des` is read only where there is no measured torque, and then it is told."""
    titles = [*(f"q{j}" for j in range(1, 8)), *(f"tau_des_{j}" for j in range(1, 8))]
    rows = np.column_stack([clean.t, clean.q, clean.tau])
    log = tmp_path / "log.csv"
    np.savetxt(log, rows, delimiter=",", header=",".join(["time", *titles]), comments="")
    assert "tau_des_1" in told(inspect_log(log, lib))["not_measured"]
    titles += [f"tau_{j}" for j in range(1, 8)]
    rows = np.column_stack([rows, clean.tau])
    np.savetxt(log, rows, delimiter=",", header=",".join(["time", *titles]), comments="")
    found = inspect_log(log, lib)
    assert found.plan.torque.columns[0] == "tau_1"
    assert "not_measured" not in told(found)


@pytest.mark.parametrize(("scale", "said"), [(-1.0, "reversed"), (0.0, "absent")])
def test_5_gravity_the_other_way_round(lib, clean, saved, scale, said) -> None:
    """Property: only bodies that can exist tell the sign; a free fit is as good either way."""
    tau = clean.tau + (scale - 1.0) * gravity_of(lib, clean.q, lib.pi0)
    found = inspect_log(saved(clean, tau=tau), lib)
    assert said in told(found)["gravity"]
    assert trap_of(found, "gravity") == 5


def test_5_an_arm_on_the_wall(lib: Library, clean: Recording, saved) -> None:
    """Oracle: Pinocchio's inverse dynamics with gravity along x of the base."""
    model = pinocchio_model(lib.urdf(), np.array([9.81, 0.0, 0.0]))
    data, full = model.createData(), differentiate(clean)
    tau = np.array(
        [pinocchio.rnea(model, data, *row) for row in zip(full.q, full.dq, full.ddq, strict=True)]
    )
    noise = np.random.default_rng(0).normal(0, 0.05, tau.shape)
    found = inspect_log(saved(clean, tau=tau + noise), lib)
    assert "along ±x" in told(found)["gravity"]


def test_6_coupled_gears(robot, shared_data: Path) -> None:
    """Real data: the wrist of a TX40, its friction fitted joint by joint."""
    recipe = load_recipe("tx40_figaroh")
    plain = recipe.replace(friction=Friction(("viscous", "coulomb", "offset", "rotor")))
    found = inspect_log(shared_data / "data" / "tx40_figaroh", robot("tx40"), plain)
    assert set(told(found)) == {"gear_coupling"}
    assert "joint_6" in told(found)["gear_coupling"]
    assert trap_of(found, "gear_coupling") == 6


def test_6_motor_angles(robot, shared_data: Path) -> None:
    """Real data: what only the manufacturer knows is asked for, as a block to fill in."""
    found = inspect_log(shared_data / "data" / "tx40_figaroh", robot("tx40"), bare=True)
    assert set(told(found)) == {"missing_clock", "position_range"}
    assert "# [gear]" in recipe_text(found)


def test_7_rest(lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: two seconds before the motion are told and dropped."""
    count = 200
    t = np.concatenate([clean.t[0] + 0.01 * np.arange(-count, 0), clean.t])
    still = {key: np.repeat(getattr(clean, key)[:1], count, axis=0) for key in ("q", "tau")}
    noise = np.random.default_rng(0).normal(0, 1e-3, (count, 7))
    arrays = {
        key: np.concatenate([still[key] + noise * 1e-3, getattr(clean, key)]) for key in still
    }
    log = saved(clean, t=t, dq=np.concatenate([noise, clean.dq]), **arrays)
    found = inspect_log(log, lib, propose=True)
    assert set(told(found)) == {"rest"}
    assert trap_of(found, "rest") == 7
    assert found.rest[0] == pytest.approx((-2.0, 0.0), abs=0.2)
    assert found.plan.preparation.rest_speed == 0.02
    settles(found, log, lib, tmp_path)


def test_9_corrupt_rows(lib: Library, clean: Recording, tmp_path: Path) -> None:
    """Property: 1e293, a cut line, garbage and repeated headers are dropped and told by line."""
    write_recording(clean, tmp_path / "log.csv")
    lines = (tmp_path / "log.csv").read_text().splitlines()
    lines[100] = lines[100].replace(lines[100].split(",")[3], "1e293")
    lines.insert(300, lines[0])
    lines[-1] = lines[-1][:40]
    (tmp_path / "log.csv").write_text("\n".join(["logger v2", *lines]))
    found = inspect_log(tmp_path / "log.csv", lib)
    assert "Dropped 2 of 1001 rows" in told(found)["corrupt_rows"]
    assert trap_of(found, "corrupt_rows") == 9
    remarks = " ".join(f.sentence for f in found.findings if f.kind == "file_form")
    assert "repeated headers" in remarks
    assert "lines before the header" in remarks


def test_9_semicolons_and_foreign_titles(lib: Library, clean: Recording, tmp_path: Path) -> None:
    """Property: `;`, decimal commas, degrees, ms and titles of another logger, all at once."""
    degree = 180 / np.pi
    blocks = (clean.t * 1e3, clean.q * degree, clean.dq * degree, clean.tau)
    titles = ["Time [ms]"]
    for stem in ("Joint Position {} [deg]", "Joint Velocity {} [deg/s]", "Effort {}"):
        titles += [stem.format(j) for j in (2, 3, 4, 1, 5, 6, 7)]
    moved = [b[:, [1, 2, 3, 0, 4, 5, 6]] if b.ndim == 2 else b for b in blocks]
    rows = [";".join(f"{x:.9g}" for x in row) for row in np.column_stack(moved)]
    log = tmp_path / "log.csv"
    log.write_text("\n".join([";".join(titles), *rows]).replace(".", ","))
    found = inspect_log(log, lib)
    assert told(found) == {}  # titles tell everything
    assert found.plan.time.unit == "ms"
    np.testing.assert_allclose(found.recording.q, clean.q, atol=1e-6)
    bare = "\n".join([";".join(t.split(" [")[0] for t in titles), *rows]).replace(".", ",")
    log.write_text(bare)
    found = inspect_log(log, lib)
    assert set(told(found)) == {"position_unit", "velocity_unit", "time_unit"}
    settles(found, log, lib, tmp_path)


def test_9_joints_in_another_order(lib, clean, saved, tmp_path) -> None:
    """Property: every signal in the order 1, 2, 3, 0, 4, 5, 6."""
    order = [1, 2, 3, 0, 4, 5, 6]
    log = saved(clean, **{key: getattr(clean, key)[:, order] for key in ("q", "dq", "tau")})
    found = inspect_log(log, lib)
    assert set(told(found)) == {"joint_order"}
    np.testing.assert_array_equal(found.recording.q, clean.q)
    settles(found, log, lib, tmp_path)


@pytest.mark.parametrize(("key", "kind"), [("dq", "velocity_order"), ("tau", "torque_order")])
def test_9_one_signal_in_another_order(lib, clean, saved, tmp_path, key, kind) -> None:
    """Property: dq and τ are each held against q."""
    order = [1, 2, 3, 0, 4, 5, 6]
    log = saved(clean, **{key: getattr(clean, key)[:, order]})
    found = inspect_log(log, lib)
    assert set(told(found)) == {kind}
    np.testing.assert_array_equal(getattr(found.recording, key), getattr(clean, key))
    settles(found, log, lib, tmp_path)


def test_10_degrees(lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: told by the limits, with dq in rad/s beside it or without dq."""
    log = saved(clean, q=clean.q * 180 / np.pi)
    found = inspect_log(log, lib)
    assert set(told(found)) == {"position_unit"}
    assert trap_of(found, "position_unit") == 10
    settles(found, log, lib, tmp_path)
    assert set(told(inspect_log(saved(clean, q=clean.q * 180 / np.pi, dq=None), lib))) == {
        "position_unit"
    }


def test_10_wrap(lib: Library, clean: Recording, saved) -> None:
    """Property: jumps of one turn are unwrapped by the reader and told."""
    q = clean.q.copy()
    middle = np.median(q[:, 0])
    q[:, 0] = (q[:, 0] - middle) % (2 * np.pi) + middle
    found = inspect_log(saved(clean, q=q), lib)
    assert trap_of(found, "wrap") == 10


@pytest.mark.parametrize("gain", [1e3, np.array([10.0, 9, 11, 10, 40, 45, 38])])
def test_11_effort_is_no_torque(lib, clean, saved, tmp_path, gain) -> None:
    """Property: one factor of 1000 is a unit; one for each joint are gains, to 30 % by the URDF."""
    log = saved(clean, tau=clean.tau * gain)
    found = inspect_log(log, lib)
    assert set(told(found)) == {"torque_unit"}
    assert trap_of(found, "torque_unit") == 11
    if np.ndim(gain):
        assert "no calibration" in told(found)["torque_unit"]
        # The example's links are up to 10 % off the URDF's, those of the wrist more by leverage.
        np.testing.assert_allclose(found.plan.torque.gain[1:4], 1 / gain[1:4], rtol=0.3)
    else:
        assert found.plan.torque.unit == "mN*m"
    settles(found, log, lib, tmp_path)


def test_saturation(lib: Library, clean: Recording, saved) -> None:
    """Property: flat tops of a clipped torque are counted, the joint named."""
    tau = clean.tau.copy()
    tau[:, 1] = np.clip(tau[:, 1], -25.0, 25.0)
    clipped = int(np.sum(np.abs(tau[:, 1]) == 25.0))
    assert clipped > 20
    found = inspect_log(saved(clean, tau=tau), lib)
    assert "fr3_joint2" in told(found)["saturation"]


def test_8_rounding_is_told_by_symgen(shared_data: Path) -> None:
    """Published model: four-digit angles; `symgen inspect` says so and finds the 43 that remain."""
    from symgen.inspect import inspect_file

    found = inspect_file(shared_data / "models" / "kinova_gen3" / "kinova.urdf")
    assert any("angles are rounded" in note for note in found.notes)
    assert found.base is not None
    assert len(found.base.names) == 43
    assert found.base.condition < 1e4  # with the rounding taken at its word it is 1e7


@pytest.mark.parametrize(
    "changed",
    [
        *({"rows": rows} for rows in (1, 2, 5, 20, 60)),
        {"tau": 0.0},
        {"q": 1e6},
        {"t": 0.0},
    ],
    ids=str,
)
def test_absurd_logs_are_sentences(lib, clean, saved, tmp_path, changed) -> None:
    """Property: too short, silent or absurd logs end in findings, and in a recipe that loads."""
    rows = slice(changed.pop("rows", None))
    arrays = {key: getattr(clean, key)[rows] for key in ("t", "q", "dq", "tau")}
    arrays |= {key: factor * arrays[key] for key, factor in changed.items()}
    found = inspect_log(saved(clean, **arrays), lib)
    assert told(found)
    (tmp_path / "r.toml").write_text(recipe_text(found), encoding="utf-8")
    load_recipe(tmp_path / "r.toml")


def test_files_of_another_kind_are_sentences(lib: Library, tmp_path: Path) -> None:
    """Property: an unknown suffix, text without numbers, a folder without logs."""
    for name, text in (("log.dat", "1 2 3"), ("log.csv", "hello\nworld\n"), ("log.npz", "x")):
        (tmp_path / name).write_text(text)
        with pytest.raises(RecordingError, match="expected"):
            inspect_log(tmp_path / name, lib)
    (tmp_path / "empty").mkdir()
    with pytest.raises(RecordingError, match="7 joint positions"):
        inspect_log(tmp_path / "empty", lib)


def test_a_torque_of_something_else(lib: Library, clean: Recording, saved) -> None:
    """Property: noise in place of τ is explained by nothing, and no tool is made of it."""
    tau = np.random.default_rng(0).normal(0, 5, clean.tau.shape)
    assert set(told(inspect_log(saved(clean, tau=tau), lib))) == {"unexplained"}


# --- the command line --------------------------------------------------------------------------


def test_command(command, lib: Library, clean: Recording, saved, tmp_path: Path) -> None:
    """Property: exit codes 0, 1 and 2; recipe, picture and JSON; nothing written on failure."""
    robot = ("--robot", lib.folder)
    fine = command("inspect", EXAMPLE, *robot, "--plot", "log.png")
    assert fine.code == 0, fine.err
    assert "0 error(s), 0 warning(s)" in fine.out
    assert (tmp_path / "log.png").read_bytes().startswith(b"\x89PNG")
    assert command("inspect", EXAMPLE, *robot, "--strict").code == 1

    log = saved(clean, tau=-clean.tau)
    bad = command("inspect", log, *robot, "--recipe-out", "r.toml", "--json")
    assert bad.code == 1, bad.err
    facts = json.loads(bad.out[bad.out.index("{") :])
    sign = next(f for f in facts["findings"] if f["kind"] == "torque_sign")
    assert sign["trap"] == 3
    assert sign["level"] == "error"
    assert (tmp_path / "r.toml").read_text() == facts["recipe"]
    assert command("inspect", log, *robot, "--recipe", "r.toml").code == 0
    ran = command("identify", log, *robot, "--recipe", "r.toml", "--cutoff", "auto", "--out", "o")
    assert ran.code == 0, ran.err
    notes = json.loads((tmp_path / "o" / "result.json").read_text())["warnings"]
    assert any(note.startswith("cut-off ") for note in notes)

    broken = command("inspect", tmp_path / "none.csv", *robot, "--recipe-out", "no.toml")
    assert broken.code == 2
    assert broken.err.count("\n") == 1
    assert not (tmp_path / "no.toml").exists()
    assert "--cutoff needs" in command("identify", log, *robot, "--cutoff", "high").err
    assert "expected to end in" in command("inspect", EXAMPLE, *robot, "--plot", "a.bmp").err


def test_raw_files_to_result(command, lib: Library, shared_data: Path, tmp_path: Path) -> None:
    """Real data: bare files of a Panda to 1.32 % or less, without a line by hand."""
    raw, robot = shared_data / "data" / "panda_gaz", ("--robot", lib.folder)
    assert command("inspect", raw, *robot, "--recipe-out", "r.toml").code == 1
    ran = command("identify", raw, *robot, "--recipe", "r.toml", "--out", "out")
    assert ran.code == 0, ran.err
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    assert facts["torque_error_percent"]["after_overall"] < 1.32
    assert (tmp_path / "out" / "report.html").exists()
