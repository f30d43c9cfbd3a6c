"""motion_export: every file holds the motion, and only a proven one is written."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import BPoly

from runtime import read_recording
from runtime.errors import ExportError, IdentificationError, RuntimeFault
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion_export import MOTION_FORMATS, export_trajectory
from runtime.excitation.proof.certificate import certificate_of, certified, pulled_inside
from runtime.library import Library
from tests.runtime.conftest import Command

ALL = ("all",)


@pytest.fixture
def motion(lib: Library, trajectories: tuple[Trajectory, ...]) -> Trajectory:
    return pulled_inside(lib, trajectories[0])


def loaded_message(path: Path) -> dict[str, list[list[float]]]:
    """The YAML of the file, line by line; flow lists are JSON too."""
    text = path.read_text()
    result = {
        key: [json.loads(row) for row in re.findall(rf"^[- ] {key}: (\[.*\])$", text, re.MULTILINE)]
        for key in ("positions", "velocities", "accelerations", "effort")
    }
    stamps = re.findall(r"^  time_from_start: \{sec: (\d+), nanosec: (\d+)\}$", text, re.MULTILINE)
    result["t"] = [[int(sec), int(nanosec)] for sec, nanosec in stamps]
    result["names"] = re.findall(r'^- "(.*)"$', text, re.MULTILINE)
    return result


@pytest.mark.parametrize("kind", ["csv", "npz"])
@pytest.mark.parametrize("rate", [1000.0, 333.0])
def test_tables_are_the_motion(
    lib: Library, motion: Trajectory, tmp_path: Path, kind: str, rate: float
) -> None:
    """Oracle: read back by the reader of logs, against the trajectory itself."""
    path = export_trajectory(
        certified(lib, motion), tmp_path / "new" / "m", kind, rate, unchecked=ALL
    )
    assert path.name == f"m.{kind}"
    log = read_recording(path)
    assert log.t == pytest.approx(np.arange(round(10 * rate) + 1) / rate, abs=1e-15)
    for result, wanted in zip((log.q, log.dq, log.ddq), motion.at(lib, log.t), strict=False):
        # 17 digits on disk.
        assert result == pytest.approx(wanted, abs=1e-12)
    if kind == "npz":
        with np.load(path) as file:
            assert file["joint_names"].tolist() == list(lib.joint_names)
            assert "acceleration: at most" in " ".join(file["history"])


def test_ros_message(lib: Library, motion: Trajectory, tmp_path: Path) -> None:
    """Oracle: fields of trajectory_msgs/JointTrajectory; numbers of the motion at the stamps."""
    path = export_trajectory(certified(lib, motion), tmp_path / "m", "ros", 300.0, unchecked=ALL)
    message = loaded_message(path)
    assert message["names"] == list(lib.joint_names)
    stamps = np.array(message["t"])
    assert stamps[1].tolist() == [0, 3_333_333]
    assert stamps[-1].tolist() == [10, 0]
    assert (stamps[:, 1] < 1_000_000_000).all()
    assert (len(message["effort"]), message["effort"][0]) == (3001, [])
    t = stamps @ [1.0, 1e-9]
    wanted = motion.at(lib, t)
    for k, key in enumerate(("positions", "velocities", "accelerations")):
        assert np.array(message[key]) == pytest.approx(wanted[k], abs=1e-12)
    text = path.read_text()
    assert text.startswith("# Excitation of 'fr3', 10 s.")
    assert "\nheader:\n  stamp: {sec: 0, nanosec: 0}\n  frame_id: ''\njoint_names:\n- " in text
    assert not re.search(r"[\[ ]\d+e", text), "YAML 1.1 takes 1e-05 for text"


@pytest.mark.parametrize("duration", [10.0, 10.0004, 9.9996, 12.3])
def test_libfranka_table(lib: Library, motion: Trajectory, tmp_path: Path, duration: float) -> None:
    """Oracle: one row per millisecond, from rest at home to rest at home, whole ms upwards."""
    motion = Trajectory(lib.home, 0.9 * motion.coefficients, duration).slowed(1.0)
    path = export_trajectory(
        certified(lib, motion), tmp_path / "m", "libfranka", rate=7.0, unchecked=ALL
    )
    lines = path.read_text().splitlines()
    comments = [line for line in lines if line.startswith("# ")]
    table = np.loadtxt(lines[len(comments) + 1 :], delimiter=",")
    steps = {10.0: 10000, 10.0004: 10001, 9.9996: 10000, 12.3: 12300}[duration]
    assert table.shape == (steps + 1, 22)
    np.testing.assert_allclose(table[:, 0], np.arange(steps + 1) * 1e-3, rtol=1e-6, atol=1e-12)
    wanted = np.hstack(motion.at(lib, np.minimum(table[:, 0], duration))[:3])
    np.testing.assert_allclose(table[:, 1:], wanted, rtol=1e-6, atol=1e-12)
    rest = np.concatenate([lib.home, np.zeros(14)])
    # Coefficients of up to 100, times (2πM)² for the acceleration, cancel at rest.
    assert table[[0, -1], 1:] == pytest.approx(np.tile(rest, (2, 1)), abs=1e-9)
    titles = lines[len(comments)].split(",")
    assert (titles[0], titles[1], titles[21]) == (
        *("t [s]", "q fr3_joint1 [rad]"),
        "ddq fr3_joint7 [rad/s^2]",
    )
    assert comments[-1] == "# joint order: " + ", ".join(lib.joint_names)
    assert any("velocity: at most" in line for line in comments)


@pytest.mark.parametrize("kind", MOTION_FORMATS)
def test_the_certificate_lies_beside(
    lib: Library, motion: Trajectory, tmp_path: Path, kind: str
) -> None:
    """Property: two files and no draft; the JSON is what `certificate` says."""
    path = export_trajectory(certified(lib, motion), tmp_path / "a.b", kind, 100.0, unchecked=ALL)
    assert {p.name for p in tmp_path.iterdir()} == {path.name, "a.b.certificate.json"}
    facts = json.loads((tmp_path / "a.b.certificate.json").read_text())
    proof = certificate_of(lib, motion)
    assert (facts["robot"], facts["holds"], facts["duration"]) == ("fr3", True, 10.0)
    assert [u["bound"] for u in facts["uses"]] == [u.bound for u in proof.uses]


@pytest.mark.parametrize("kind", MOTION_FORMATS)
@pytest.mark.parametrize(
    ("scale", "duration", "match"),
    [
        (0.9, 5.0, r"acceleration of fr3_joint\d at .* add --speed \d\d, at which"),
        (1.1, 10.0, "position of fr3_joint.* design another motion"),
        (np.nan, 10.0, "position of fr3_joint1 at nan .* design another motion"),
    ],
)
def test_nothing_unproven_is_written(
    lib: Library,
    motion: Trajectory,
    tmp_path: Path,
    kind: str,
    scale: float,
    duration: float,
    match: str,
) -> None:
    """Property: one sentence with limit, joint, time and remedy; no file; the remedy helps."""
    bad = Trajectory(lib.home, scale * motion.coefficients, duration)
    with pytest.raises(ExportError, match=match) as caught:
        export_trajectory(certified(lib, bad), tmp_path / "m", kind, unchecked=ALL)
    assert list(tmp_path.iterdir()) == []
    if advice := re.search(r"--speed (\d+)", str(caught.value)):
        slow = bad.slowed(int(advice[1]) / 100)
        export_trajectory(certified(lib, slow), tmp_path / "m", kind, 100.0, unchecked=ALL)


def test_wrong_words(lib: Library, motion: Trajectory, tmp_path: Path) -> None:
    """Property: an unknown kind, a rate without meaning, a place that cannot be written."""
    with pytest.raises(
        ExportError, match="no format of motions 'xml'; choose from csv, npz, ros, libfranka"
    ):
        export_trajectory(certified(lib, motion), tmp_path / "m", "xml", unchecked=ALL)
    for rate in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(RuntimeFault, match="sampling rate"):
            export_trajectory(certified(lib, motion), tmp_path / "m", "ros", rate, unchecked=ALL)
    (tmp_path / "file").write_text("mine")
    with pytest.raises(RuntimeFault, match="cannot write"):
        export_trajectory(
            certified(lib, motion), tmp_path / "file" / "m", "ros", 10.0, unchecked=ALL
        )


def test_an_export_needs_consent_for_what_is_not_checked(
    lib: Library, motion: Trajectory, tmp_path: Path
) -> None:
    """Property: one sentence with every unchecked limit; with consent the file lists them."""
    document = certified(lib, motion)
    kinds = ("torque", "position-dependent velocity", "torque rate", "tip speed")
    kinds = (*kinds, "self-collision", "table")
    assert document.certificate.unchecked == kinds
    with pytest.raises(ExportError, match=f"not checked: {', '.join(kinds)}; give --criterion"):
        export_trajectory(document, tmp_path / "m", "ros", 100.0)
    some = [kind for kind in kinds if kind != "tip speed"]
    with pytest.raises(
        ExportError, match=r"not checked: tip speed; .* --settings unchecked=tip-speed$"
    ):
        export_trajectory(document, tmp_path / "m", "ros", 100.0, unchecked=some)
    with pytest.raises(ExportError, match=r"the setting unchecked takes .*, got 'everything'"):
        export_trajectory(document, tmp_path / "m", "ros", 100.0, unchecked=["everything"])
    assert list(tmp_path.iterdir()) == []
    words = [kind.replace(" ", "-") for kind in kinds]
    text = export_trajectory(document, tmp_path / "m", "ros", 100.0, unchecked=words).read_text()
    assert [f"# NOT checked: {kind}" in text for kind in kinds] == [True] * len(kinds)


def test_excite_asks_before_the_search(
    command: Command, lib: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: exit code 2 and one sentence before a search, --table none is an answer."""
    from runtime.cli import excite

    def searching(*_: object, **__: object) -> None:
        raise IdentificationError("the search has begun")

    monkeypatch.setattr(excite, "design", searching)
    words = ("excite", "--robot", lib.folder, "--out", "m.json", "--export", "ros")
    for options, sentence in (
        ((), "not checked: table; give --table Z for a table at this height or --table none, or "),
        (
            ("--settings", "document=true"),
            "not checked: torque, position-dependent velocity, torque rate",
        ),
        (("--table", "none"), "the search has begun"),
        (("--table", "0"), "the search has begun"),
        (("--settings", "unchecked=table"), "the search has begun"),
        (("--settings", "document=true", "--settings", "unchecked=all"), "the search has begun"),
        (("--table", "low"), "--table needs a height in m in the base frame, or none"),
        (("--table", "none", "--carry", "1,0,0,0.1"), "not checked: carried body; give a box"),
    ):
        ran = command(*words, *options)
        assert (ran.code, ran.err.count("\n")) == (2, 1), options
        assert sentence in ran.err, options


def test_tip_speed_is_its_share(lib: Library, motion: Trajectory) -> None:
    """Property: the use of the tip's speed is v / v_max, as with all other limits."""
    slow = motion.slowed(0.5)
    uses = certificate_of(lib, slow, Safety()).uses
    use = next(use for use in uses if use.kind == "tip speed")
    t = np.linspace(0, slow.duration, 20_001)
    q, dq, *_ = slow.at(lib, t)
    fastest = np.linalg.norm(lib.tip_motion(q, dq)[1], axis=1).max()
    assert use.bound == pytest.approx(use.value / use.limit, rel=1e-12)
    # The bound between samples of a millisecond.
    assert use.bound == pytest.approx(fastest / lib.limits()["tip_speed"], rel=1e-3)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            ("--settings", f"harmonics={8}", "--duration", 0.3),
            "too seldom for 8 functions per joint",
        ),
        (
            ("--settings", f"harmonics={400}", "--duration", 5),
            "too seldom for 400 functions per joint",
        ),
        (("--settings", "home=0,1"), "the setting home needs 7 numbers with commas, got '0,1'"),
        (("--settings", "home=9,0,0,-2,0,2,0"), "is not inside its limits .* choose another home"),
        (("--settings", "home=nan,0,0,-2,0,2,0"), "home"),
        (("--table", 0, "--box", "0.2,0.8,-0.5,0.5,0.1,1.0"), "choose another home or limit"),
    ],
)
def test_options_without_a_motion_are_one_sentence(
    command: Command, lib: Library, words: tuple[object, ...], sentence: str
) -> None:
    """Property: exit code 2, no traceback, no file."""
    ran = command(
        "excite", "--robot", lib.folder, "--settings", f"starts={1}", "--out", "m.json", *words
    )
    assert (ran.code, ran.err.count("\n")) == (2, 1), ran.err
    assert re.search(sentence, ran.err), ran.err
    assert not Path("m.json").exists()


def test_the_example_of_the_help(command: Command, lib: Library) -> None:
    """Property: table, box and home of the help give a motion from that home."""
    page = " ".join(command("excite", "--help").out.split())
    example = re.search(r"--settings home=(\S+) --table (\S+) --box (\S+)", page)
    assert example is not None
    home, table, box = example.groups()
    words = (
        "--duration",
        4,
        "--settings",
        f"harmonics={2}",
        "--settings",
        f"starts={1}",
        "--out",
        "m.json",
    )
    words = (*words, "--settings", f"home={home}", "--table", table, "--box", box)
    ran = command("excite", "--robot", lib.folder, *words)
    assert ran.code == 0, ran.err
    facts = json.loads(Path("m.json").read_text())
    assert facts["home"] == [float(q) for q in home.split(",")]
    assert "holds at every instant" in ran.out


def test_ros_files_load_in_a_second(lib: Library, motion: Trajectory, tmp_path: Path) -> None:
    """Property: few points by default, and quintic polynomials through them are the motion.

    A parser of YAML in Python takes 0.1 ms per number: 1e4 numbers are a second.
    """
    path = export_trajectory(certified(lib, motion), tmp_path / "m", "ros", unchecked=ALL)
    message = loaded_message(path)
    knots = np.array(message["t"]) @ [1.0, 1e-9]
    orders = [np.array(message[key]) for key in ("positions", "velocities", "accelerations")]
    assert sum(rows.size for rows in orders) < 1e4
    spline = BPoly.from_derivatives(knots, np.stack(orders, axis=1))
    t = np.linspace(0.0, 10.0, 5001)
    # h⁶/46080 · max|q⁽⁶⁾| with h = 40 ms and five harmonics of 0.1 to 0.5 Hz with up to 2.5 rad.
    assert spline(t) == pytest.approx(motion.at(lib, t)[0], abs=1e-6)
