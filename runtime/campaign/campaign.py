"""A campaign: design, run in stages, identify, until a target is reached; every step is a file.

    motion-K.json   design, with the information of the logs so far
    rehearsal-K.json  the motion on the virtual robot with planted faults
    gate-K-S.json   decision on the stage at S % of the speed
    log-K-S.npz     samples of the stage
    result-K/       identification from all logs so far
    state.json      settings, and the accuracy after every motion
    report.md       the whole campaign

A step whose file exists is done, so that the same call continues after an interruption; files
appear complete or not at all.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from runtime.campaign.driver import START, Driver
from runtime.campaign.gate import EMPTY_CELL, rehearse, released, unnoticed
from runtime.campaign.gear_friction import ArmModel, agreement_of, arm_model, smoothed
from runtime.campaign.guards import model_error, usual_guards
from runtime.campaign.shortest_session import Target, known_before, reached, torque_noise
from runtime.common.files import DRAFT, json_of, write_json, write_text
from runtime.errors import IdentificationError
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.excitation.search.design import design, write_trajectory
from runtime.excitation.search.information import Information, information
from runtime.excitation.way import way_to
from runtime.identification.result_file import write_result
from runtime.library import Array, Library
from runtime.recording import Recording, read_recording, write_recording

REPORT = "report.md"
HARMONICS = 5
LEAST_MOTIONS = 2
"""Motions before a target counts as reached: the few seconds of the first one at full speed hardly
determine what the friction columns depend on, and other minima look like noise."""
UNSEEN_LATER = 0.2  # share of friction and ripple not yet seen that a further motion may still show
STATE = "state.json"
NEAR = START / 2  # distance from the start below which a robot stays where it is [rad, m]
WAY_SPEED = 0.1  # share of full speed on the way to the start


@dataclass(frozen=True, slots=True)
class Plan:
    """Settings of a campaign."""

    target: str  # text of the target
    duration: float = 2.5  # of the first motion at full speed [s]
    later_duration: float = 10.0  # of every further motion at full speed [s]
    # speeds of the first motion, percent of full speed, in the order of their runs; further motions
    # run at the last of them, with a model that full speed has confirmed
    stages: tuple[float, ...] = (10.0, 50.0, 100.0)
    most_seconds: float = 600.0  # motion time after which no further motion is begun [s]
    seed: int = 0  # of the designs
    rehearses: bool = True  # every motion runs on the virtual robot with planted faults first

    def __post_init__(self) -> None:
        rising = all(a < b for a, b in zip(self.stages, self.stages[1:], strict=False))
        if not self.stages or not rising or not self.stages[0] > 0 or self.stages[-1] > 100:
            shown = ",".join(f"{each:g}" for each in self.stages)
            raise IdentificationError(
                f"expected rising speeds above 0 and up to 100 %, got {shown}; correct the "
                f"setting stages"
            )

    def duration_of(self, k: int) -> float:
        """Duration of motion K = 1, 2, … at full speed [s]."""
        return self.duration if k == 1 else self.later_duration

    def stages_of(self, k: int) -> tuple[float, ...]:
        """Speeds of motion K = 1, 2, …, percent of full speed."""
        return self.stages if k == 1 else self.stages[-1:]

    def seconds(self, k: int) -> float:
        """Time of all stages of motion K = 1, 2, … [s]."""
        return self.duration_of(k) * sum(100 / speed for speed in self.stages_of(k))


@dataclass(frozen=True, slots=True)
class CampaignOutcome:
    """End of a campaign."""

    is_reached: bool  # whether the target is reached
    sigma: float  # standard deviation of the quantity of the target [N·m, 1, kg]
    motions: int  # number of motions
    seconds: float  # motion time of all stages [s]
    sentence: str  # why it ended


def run_campaign(
    driver: Driver,
    plan: Plan,
    target: Target,
    folder: Path,
    say: Callable[[str], None] = lambda _: None,
    on_model: Callable[[ArmModel], None] = lambda _: None,
    safety: Safety = EMPTY_CELL,
) -> CampaignOutcome:
    """Run a campaign, or continue it from its files."""
    lib = driver.lib
    model_error(lib)  # the guards need it; before a motion is designed and rehearsed
    described = {
        "robot": lib.name,
        "model_hash": lib.manifest.model_hash,
        "plan": asdict(plan) | {"stages": list(plan.stages)},
        "limits": limits_facts(safety),
    }
    state = opened_state(folder, described)
    logs: list[tuple[str, Recording]] = []
    model: ArmModel | None = None
    agreement: tuple[float, ...] | None = None
    k, seconds, sigma = 0, 0.0, float("inf")
    is_reached = False
    while not is_reached and seconds + plan.seconds(k + 1) <= plan.most_seconds:
        k += 1
        motion = _designed(lib, plan, target, folder / f"motion-{k}.json", k, model, safety)
        say(f"motion {k}: {motion.duration:g} s")
        if plan.rehearses:
            _rehearsed(lib, plan, motion, folder / f"rehearsal-{k}.json", k)
        for speed in plan.stages_of(k):
            slowed = replace(motion, duration=motion.duration * 100 / speed)
            name = f"log-{k}-{speed:g}"
            path = folder / f"{name}.npz"
            if not path.exists():
                last = folder / f"{logs[-1][0]}.npz" if logs else None
                release = released(lib, slowed, last, agreement, safety)
                write_json(folder / f"gate-{k}-{speed:g}.json", release.to_facts(), allow_nan=True)
                if not release.is_released:
                    raise IdentificationError(
                        f"motion {k} at {speed:g} % of its speed is refused: "
                        f"{'; '.join(release.reasons)}"
                    )
                _recorded(driver, slowed, path, name, safety, say)
                say(f"motion {k} at {speed:g} %: released, {slowed.duration:g} s recorded")
            log = smoothed(read_recording(path, joints=lib.joint_names), lib)
            unseen = 1.0 if k <= LEAST_MOTIONS else UNSEEN_LATER
            agreement = None if model is None else agreement_of(model, log, unseen)
            logs.append((name, log))
            seconds += slowed.duration
            first = 0 if k == 1 else len(plan.stages) - 1  # slow stages show the least
            model = arm_model(lib, logs, first)
            on_model(model)
        if model is None:  # a plan has stages
            break
        write_result(model.result, folder / f"result-{k}", f"campaign --target {plan.target}")
        sigma = reached(target, model.result, motion)
        facts = {"sigma": sigma, "seconds": seconds, "friction_columns": model.gear.facts()}
        state["motions"] = [*state["motions"][: k - 1], facts]
        write_json(folder / STATE, state, allow_nan=True)
        say(f"motion {k}: σ is {target.shown(sigma)}, the target {target.shown(target.value)}")
        is_reached = k >= LEAST_MOTIONS and sigma <= target.value
    how = "reached" if is_reached else "not reached within the time"
    known = f"σ is {target.shown(sigma)}" if k else "no motion fits into the time"
    sentence = f"the target {target.text} is {how}: {known}, {k} motions, {seconds:g} s of motion"
    outcome = CampaignOutcome(is_reached, sigma, k, seconds, sentence)
    write_text(folder / REPORT, _report(folder, plan, target, outcome))
    return outcome


def _designed(
    lib: Library,
    plan: Plan,
    target: Target,
    path: Path,
    k: int,
    model: ArmModel | None,
    safety: Safety,
) -> Trajectory:
    """Read motion K, or design it with the information of all logs so far."""
    if path.exists():
        return read_trajectory(path, lib)
    known: Information = information(lib, payload=target.kind == "payload")
    if model is not None:
        noise, rate = torque_noise(model.result)
        earlier = None if target.kind == "payload" else known_before(model.result, lib)
        known = information(lib, noise, rate, earlier, payload=target.kind == "payload")
    designed = design(
        lib,
        duration=plan.duration_of(k),
        harmonics=HARMONICS,
        starts=1,
        seed=plan.seed + k,
        criterion=target.criterion,
        information=known,
        safety=safety,
        margin=0.9,
    )
    write_trajectory(designed, lib, path)
    return read_trajectory(path, lib)


def _rehearsed(lib: Library, plan: Plan, motion: Trajectory, path: Path, k: int) -> None:
    """Rehearse a motion; refuse it where a planted fault would pass unnoticed."""
    if not path.exists():
        verdicts = rehearse(lib, motion, plan.seed + k)
        facts = {"faults": [asdict(each) for each in verdicts]}
        write_json(path, facts | {"unnoticed": list(unnoticed(verdicts, lib))})
    left = json_of(path)["unnoticed"]
    if left:
        option = "--duration" if k == 1 else "the setting later_duration"
        raise IdentificationError(
            f"motion {k} is refused in rehearsal: {'; '.join(left)}; begin another campaign "
            f"(--out) with longer motions ({option} above {plan.duration_of(k):g})"
        )


def _recorded(
    driver: Driver,
    motion: Trajectory,
    path: Path,
    name: str,
    safety: Safety,
    say: Callable[[str], None],
) -> None:
    """Run one stage from its start; a stopped stage is repeated, its log is written beside it."""
    move_to(driver, motion.home, safety, say)
    done = driver.stream(motion, guards=usual_guards(driver.lib, driver.rate_hz))
    if done.stop is None:
        write_recording(done.recording(driver.lib, name), path)
        return
    kept = path.with_name(f"{name}.stopped.npz")
    if done.samples:
        write_recording(done.recording(driver.lib, name), kept)
    raise IdentificationError(
        f"{name} was stopped after {done.stop.seconds:.3f} s by {done.stop.guard} "
        f"({done.stop.sentence}); its samples are in '{kept}'; repeat the command to continue"
    )


def _report(folder: Path, plan: Plan, target: Target, outcome: CampaignOutcome) -> str:
    state = json_of(folder / STATE)
    lines = [
        f"# Campaign of {state['robot']}",
        "",
        f"{outcome.sentence[:1].upper()}{outcome.sentence[1:]}.",
    ]
    lines += ["", "| motion | motion time | σ | gates |", "|---|---|---|---|"]
    for k, motion in enumerate(state["motions"], 1):
        gates = [json_of(folder / f"gate-{k}-{speed:g}.json") for speed in plan.stages_of(k)]
        passed = "released" if all(each["released"] for each in gates) else "refused"
        sigma = target.shown(motion["sigma"])
        lines.append(f"| {k} | {motion['seconds']:g} s | {sigma} | {passed} |")
    return "\n".join([*lines, ""])


def limits_facts(safety: Safety) -> dict[str, Any] | None:
    """Limits beyond those of the robot, JSON-ready; None where there are none."""
    usual = asdict(Safety())
    beyond = {key: value for key, value in asdict(safety).items() if value != usual[key]}
    facts: dict[str, Any] = json.loads(json.dumps(beyond))
    return facts or None


def opened_state(folder: Path, described: dict[str, Any]) -> dict[str, Any]:
    """Content of state.json; a new one where the folder has none."""
    path = folder / STATE
    is_new, state = not path.exists(), described | {"motions": []}
    # Motions may be given; they are read and never replaced.
    given = ("motion-*.json", f"{DRAFT}*")
    if not is_new:
        state = json_of(path)
        if not isinstance(state, dict) or any(state.get(k) != described[k] for k in described):
            raise IdentificationError(
                f"'{folder}' holds a campaign of another robot or with other settings; choose "
                "another folder with --out, or give the same settings"
            )
    elif folder.is_dir() and not all(any(map(f.match, given)) for f in folder.iterdir()):
        raise IdentificationError(
            f"'{folder}' has files and is no folder of a campaign; choose a new or empty one "
            "with --out"
        )
    for draft in folder.rglob(f"{DRAFT}*"):  # of a process that was killed
        draft.unlink(missing_ok=True)
    if is_new:
        write_json(path, state, allow_nan=True)
    return state


def move_to(
    driver: Driver, start: Array, safety: Safety, say: Callable[[str], None] = lambda _: None
) -> None:
    """Let the robot follow a certified way from where it stands: start (n,) [rad, m]."""
    here = driver.state().q
    if not np.abs(here - start).max() > NEAR:
        return
    way = way_to(driver.lib, here, start, safety).trajectory
    if way is None:
        return
    slow = way.slowed(WAY_SPEED)
    say(f"the robot moves to the start, {slow.duration:.3g} s at {100 * WAY_SPEED:g} % speed")
    done = driver.stream(slow, guards=usual_guards(driver.lib, driver.rate_hz))
    if done.stop is not None:
        raise IdentificationError(
            f"the way to the start was stopped after {done.stop.seconds:.3f} s by "
            f"{done.stop.guard} ({done.stop.sentence}); clear the way and repeat the command"
        )
