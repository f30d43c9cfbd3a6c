"""Campaigns on the virtual robot: every step is a file, and the same call continues."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from runtime import load, read_recording, write_recording
from runtime.campaign import campaign
from runtime.campaign.campaign import Plan, run_campaign
from runtime.campaign.driver import Reference, Sample, Stop, Streamed
from runtime.campaign.drivers.virtual import PlantedFault, VirtualDriver
from runtime.campaign.gate import EMPTY_CELL, _planted, rehearsed, released
from runtime.campaign.gear_friction import ArmModel
from runtime.campaign.shortest_session import base_covariance, reached, target_of
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Obstacle, Safety
from runtime.excitation.motion.trajectory import JoinedMotion, read_trajectory, write_motion
from runtime.excitation.proof.certificate import certificate_of
from runtime.excitation.search.criteria import unseen_joints
from runtime.excitation.search.design import Design, design
from runtime.excitation.search.information import Information
from runtime.identification.saved_result import read_result
from runtime.library import Library
from runtime.recording import Recording
from tests.runtime.conftest import Command

MOTION = Path(__file__).parents[3] / "runtime" / "examples" / "fr3_trajectory.json"
PLAN = Plan("v=2Nm", duration=4.0, stages=(100.0,), most_seconds=4.0, rehearses=False)


class DeadRobot(VirtualDriver):
    """A robot that must not move."""

    def exchange(self, reference: Reference) -> Sample:
        raise AssertionError("the robot was moved")


@pytest.fixture
def folder(fr3: Library, tmp_path: Path) -> Path:
    """A campaign whose first motion is designed already: searches are tested elsewhere."""
    motion = read_trajectory(MOTION, fr3)
    slow = replace(motion, coefficients=0.1 * motion.coefficients, duration=PLAN.duration)
    write_motion(slow, fr3, tmp_path / "campaign" / "motion-1.json", {})
    return tmp_path / "campaign"


def test_a_campaign_stops_at_a_fault_continues_and_ends(fr3: Library, folder: Path) -> None:
    """Property: a stopped stage is run again; a campaign that is done moves nothing.

    Oracle: the true error on motions never seen, within four of the stated σ.
    """
    target = target_of(PLAN.target)
    stuck = VirtualDriver(fr3, fault=PlantedFault("collision", 0.5, 1))
    with pytest.raises(IdentificationError, match=r"log-1-100 was stopped after 0\.50. s by ext"):
        run_campaign(stuck, PLAN, target, folder)
    assert 500 <= len(read_recording(folder / "log-1-100.stopped.npz").t) <= 505
    robot = VirtualDriver(fr3, truth_seed=2)
    outcome = run_campaign(robot, PLAN, target, folder)
    assert (outcome.motions, outcome.seconds) == (1, 4.0)
    again = run_campaign(DeadRobot(fr3), PLAN, target, folder)
    assert again == outcome
    saved = read_result(folder / "result-1")
    seen = np.sum(unseen_joints(fr3, fr3.home), axis=0)
    error = fr3.base_matrix @ (saved.pi - robot.pi)
    assert np.sqrt(error @ seen @ error) < 4 * outcome.sigma
    assert f"| 1 | 4 s | {target.shown(outcome.sigma)} | released |" in (
        folder / "report.md"
    ).read_text(encoding="utf-8")
    with pytest.raises(IdentificationError, match="another robot or with other settings"):
        run_campaign(robot, replace(PLAN, seed=1), target, folder)


def test_missing_limits_are_named_before_anything_is_designed(
    double: Library, tmp_path: Path
) -> None:
    """Property: the guards need effort limits; a rehearsal of minutes came before the refusal."""
    with pytest.raises(IdentificationError, match="effort limit of elbow"):
        run_campaign(DeadRobot(double), PLAN, target_of(PLAN.target), tmp_path / "campaign")
    assert not (tmp_path / "campaign" / "motion-1.json").exists()


def test_the_way_to_the_start_keeps_away_from_obstacles(fr3: Library, folder: Path) -> None:
    """Property: the streamed way is certified with the obstacle and is not the straight one.

    A campaign without the obstacle is another one.
    """
    elsewhere = fr3.home + np.array([2.0, 0, 0, 0, 0, 0, 0])
    between = fr3.tip_motion((fr3.home + elsewhere)[None] / 2, np.zeros((1, 7)))[0][0]
    safety = Safety(obstacles=(Obstacle("ball", tuple(between), radius=0.05),))
    ways: list[JoinedMotion | Trajectory] = []

    class Stopped(VirtualDriver):
        """Stands elsewhere, and keeps the first motion in place of following it."""

        def stream(self, trajectory, on_sample=lambda _: None, guards=()) -> Streamed:
            ways.append(trajectory)
            return Streamed([], Stop("key", "test", 0.0))

    robot, target = Stopped(fr3), target_of(PLAN.target)
    robot.place(elsewhere)
    with pytest.raises(IdentificationError, match="the way to the start was stopped"):
        run_campaign(robot, PLAN, target, folder, safety=safety)
    assert not certificate_of(fr3, ways[0], safety).broken
    q = ways[0].at(fr3, np.linspace(0, ways[0].duration, 50))[0]
    assert (
        np.abs(q - fr3.home)[:, 1:].max() > 0.05
    )  # only the first joint moves on the straight one
    with pytest.raises(IdentificationError, match="another robot or with other settings"):
        run_campaign(robot, PLAN, target, folder)


def test_the_gate_refuses_a_faulty_log(fr3: Library, tmp_path: Path) -> None:
    """Property: a sign, named by the inspection of the last log; a residual beyond the band."""
    design = read_trajectory(MOTION, fr3)
    motion = replace(design, coefficients=0.1 * design.coefficients)
    log = read_recording("fr3_simulated")
    write_recording(log.replace(tau=-log.tau), tmp_path / "log.npz")
    refused = released(fr3, motion, tmp_path / "log.npz")
    assert not refused.is_released
    assert "sign" in " ".join(refused.reasons)
    refused = released(fr3, motion, None, (1.0, 1.0, 9.0, 1.0, 1.0, 1.0, 1.0))
    assert "last log on fr3_joint3 is 9 times the band" in refused.reasons[0]
    assert released(fr3, motion, None).is_released
    assert released(fr3, motion, None, (2.9,) * 7).is_released
    assert not released(fr3, motion, None, (1.0, 3.2, 1.0, 1.0, 1.0, 1.0, 1.0)).is_released
    refused = released(fr3, replace(motion, duration=1.0), None)
    assert "% of the limit of acceleration" in " ".join(refused.reasons)


def test_the_gate_counts_the_cell(fr3: Library) -> None:
    """Property: the same motion is refused where an obstacle stands at the tip."""
    design = read_trajectory(MOTION, fr3)
    motion = replace(design, coefficients=0.1 * design.coefficients)
    tip = fr3.tip_motion(fr3.home[None], np.zeros((1, 7)))[0][0]
    ball = Safety(obstacles=(Obstacle("ball", tuple(tip), radius=0.05),))
    refused = released(fr3, motion, None, safety=ball)
    assert [reason.rsplit(" ", 1)[1] for reason in refused.reasons] == ["obstacle"]


def test_a_further_motion_counts_the_earlier_logs(
    tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: a target is reached after two motions at the earliest; the second is designed
    with the information of the first one's log, (B C Bᵀ)⁻¹ of its posterior, and with room
    to its limits.
    """
    lib = load(tiny)
    plan = Plan("v=100Nm", duration=2.5, later_duration=2.0, stages=(100.0,), rehearses=False)
    designs: list[tuple[Trajectory, Information]] = []

    def designed(lib: Library, **settings: Any) -> Design:
        result = design(lib, **settings | {"budget": 1.0})
        designs.append((result.trajectory, settings["information"]))
        return result

    monkeypatch.setattr(campaign, "design", designed)
    models: list[ArmModel] = []
    robot = VirtualDriver(lib, truth_seed=2)
    outcome = run_campaign(
        robot, plan, target_of(plan.target), tmp_path / "campaign", on_model=models.append
    )
    assert (outcome.is_reached, outcome.motions, len(designs)) == (True, 2, 2)
    assert designs[0][1].earlier is None
    earlier = designs[1][1].earlier
    assert earlier is not None
    spread = base_covariance(models[0].result)
    # The floor of the inverse, 1e-12 of the trace, on directions that the data fix to rounding.
    np.testing.assert_allclose(earlier @ spread, np.eye(len(spread)), atol=1e-6)
    for motion, _ in designs:
        used = [use.bound for use in certificate_of(lib, motion, EMPTY_CELL).uses]
        assert max(used) <= 0.9


def test_later_motions_run_at_full_speed_at_once() -> None:
    """Oracle: 10 s at 20 and 100 %, then 6 s at 100 %."""
    plan = Plan("v=1Nm", duration=10.0, later_duration=6.0, stages=(20.0, 100.0))
    assert [plan.stages_of(k) for k in (1, 2, 3)] == [(20.0, 100.0), (100.0,), (100.0,)]
    assert [plan.seconds(k) for k in (1, 2, 3)] == [60.0, 6.0, 6.0]


def test_faults_are_planted_as_they_are_named() -> None:
    """Oracle: torques of three joints on straight lines by hand; the last joint changes with the
    one before it, and 10 ms are one row of 100 Hz.
    """
    t = np.arange(4) / 100.0
    tau = np.outer(t, [1.0, 2.0, 4.0])
    log = Recording(t, 0 * tau, tau=tau)
    for kind, joint, slopes in (
        *(("sign", 1, (1, -2, 4)), ("gain", 0, (1.3, 2, 4)), ("none", 0, (1, 2, 4))),
        *(("order", 0, (2, 1, 4)), ("order", 2, (1, 4, 2)), ("delay", 0, (1, 2, 4))),
    ):
        late = 1 if kind == "delay" else 0
        found = _planted(log, kind, joint).required("tau")[late:]
        np.testing.assert_allclose(found, np.outer(t[: 4 - late], slopes), atol=1e-15)


def test_a_rehearsal_names_a_planted_fault(fr3: Library) -> None:
    """Property: the sign of one torque, in 2.5 s of the virtual arm; and nothing without one."""
    motion = replace(read_trajectory(MOTION, fr3), duration=2.5)
    motion = replace(motion, coefficients=0.1 * motion.coefficients)
    planted = rehearsed(fr3, motion, "sign", 3, 1)
    assert "fr3_joint4 has the wrong sign" in " ".join(planted.sentences)
    assert rehearsed(fr3, motion, "none", 3, 1).sentences == ()


@pytest.mark.parametrize(
    ("text", "value"), [("v=5mNm", 5e-3), ("a=1.5%", 0.015), ("payload=5g", 5e-3), ("v=1Nm", 1.0)]
)
def test_targets(text: str, value: float) -> None:
    """Property: the units of a target, and its text from SI units."""
    target = target_of(text)
    assert target.value == pytest.approx(value, rel=1e-12)
    assert target.shown(value).replace(" ", "") == text.partition("=")[2]


def test_a_payload_is_weighed_on_the_arm_as_it_is_known(fr3: Library) -> None:
    """Oracle: σ of the mass by one least squares over arm, payload and offsets together.

    Rows are the mean of 401, 400 times; the covariance of the arm is that of the result.
    """
    rng, n = np.random.default_rng(0), fr3.n_joints
    root = 0.05 * np.diag(np.abs(fr3.pi0) + 0.01) @ rng.normal(size=(fr3.pi0.size, 60))
    noise = rng.uniform(0.05, 0.2, n)
    known = SimpleNamespace(root=root, noise=noise / 2, inflation=4.0)
    result = SimpleNamespace(lib=fr3, uncertainty=known, train=SimpleNamespace(rate_hz=50.0))
    motion = replace(read_trajectory(MOTION, fr3), duration=8.0)
    q, dq, ddq, _ = motion.at(fr3, np.linspace(0.0, 8.0, 401))
    arm = fr3.base_regressor(q, dq, ddq)
    offsets = np.broadcast_to(np.eye(n), (401, n, n))
    every = np.concatenate([arm, arm @ fr3.base_matrix[:, -10:], offsets], axis=2)
    every = (every / noise[:, None]).reshape(401 * n, -1)
    information = 400 / 401 * every.T @ every
    count = arm.shape[2]
    information[:count, :count] += np.linalg.inv(
        fr3.base_matrix @ root @ root.T @ fr3.base_matrix.T
    )
    sigma = np.sqrt(np.linalg.inv(information)[count, count])
    found = reached(target_of("payload=5g"), result, motion)  # type: ignore[arg-type]
    assert found == pytest.approx(sigma, rel=1e-6)


def test_bad_input(command: Command, fr3: Library, tmp_path: Path) -> None:
    """Property: one sentence, exit code 2, nothing written."""
    for words, said in (
        (("--target", "v=5"), "expected a target such as v=5mNm"),
        (("--target", "v=5mNm", "--settings", "stages=100,10"), "expected rising speeds"),
        (("--target", "v=5mNm", "--settings", "stages=fast"), "expected speeds in percent"),
    ):
        ran = command("campaign", "--robot", fr3.folder, *words, "--out", "c")
        assert ran.code == 2
        assert said in ran.err
        assert not (tmp_path / "c").exists()


def test_the_command_without_time(command: Command, fr3: Library, tmp_path: Path) -> None:
    """Property: JSON and exit code 1 where no motion fits into the time."""
    words = ("--target", "a=1%", "--settings", "most_seconds=1", "--out", "c", "--json")
    ran = command("campaign", "--robot", fr3.folder, *words)
    assert ran.code == 1
    facts = json.loads(ran.out)
    assert (facts["is_reached"], facts["motions"]) == (False, 0)


def test_a_folder_of_the_user_is_left_alone(fr3: Library, tmp_path: Path) -> None:
    """Property: files that no campaign has written are neither read nor replaced."""
    report = tmp_path / "report.md"
    report.write_text("mine", encoding="utf-8")
    with pytest.raises(IdentificationError, match="is no folder of a campaign"):
        run_campaign(VirtualDriver(fr3), PLAN, target_of("payload=5g"), tmp_path)
    assert report.read_text(encoding="utf-8") == "mine"
    assert len(list(tmp_path.iterdir())) == 1
