"""A campaign: design, run in stages, identify, until a target is reached; every step is a file.

    motion-K.json   design with what is known counted as information of earlier logs
    gate-K-S.json   decision on the stage at S % of the speed
    log-K-S.npz     samples of the stage
    result-K/       identification from all logs so far
    state.json      settings, and the accuracy after every motion
    report.md       the whole campaign

A step whose file exists is done, so that the same call continues after an interruption; files
appear complete or not at all.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from runtime.campaign.driver import Driver
from runtime.campaign.gate import released
from runtime.campaign.guards import usual_guards
from runtime.campaign.target import Target, known_before, reached, torque_noise
from runtime.errors import IdentificationError
from runtime.estimators.regression.samples import samples_of
from runtime.excitation import Safety, Trajectory, design
from runtime.excitation.search.information import Information, information
from runtime.excitation.trajectory_file import read_trajectory, write_trajectory
from runtime.files import json_of, replacing
from runtime.identification.identified import Identification, torque_of
from runtime.identification.result_file import write_result
from runtime.identification.several_logs import NamedLog, identify_logs
from runtime.identification.single_log import identify
from runtime.library import Library
from runtime.recording import Friction, Preparation, read_recording, write_recording
from runtime.recording.preprocessing import prepare

STATE, REPORT = "state.json", "report.md"
PREPARATION = Preparation(filter="butterworth", cutoff_hz=20.0, rate_hz=100.0)
"""Of every log: accelerations of stages at low speed are far below 20 Hz."""
FRICTION = Friction(("viscous", "coulomb", "offset"))
"""Columns of the identification; the offset, the last one, is one per log."""
HARMONICS = 5


@dataclass(frozen=True, slots=True)
class Plan:
    """Settings of a campaign.

    Attributes:
        target: text of the target.
        duration: of one motion at full speed [s].
        stages: speeds, percent of full speed, in the order of their runs.
        most_seconds: motion time after which no further motion is begun [s].
        seed: of the designs.
    """

    target: str
    duration: float = 5.0
    stages: tuple[float, ...] = (10.0, 50.0, 100.0)
    most_seconds: float = 600.0
    seed: int = 0

    def __post_init__(self) -> None:
        rising = all(a < b for a, b in zip(self.stages, self.stages[1:], strict=False))
        if not self.stages or not rising or not self.stages[0] > 0 or self.stages[-1] > 100:
            shown = ",".join(f"{each:g}" for each in self.stages)
            raise IdentificationError(
                f"expected rising speeds above 0 and up to 100 %, got {shown}; correct --stages"
            )

    @property
    def seconds(self) -> float:
        """Time of all stages of one motion [s]."""
        return self.duration * sum(100 / speed for speed in self.stages)


@dataclass(frozen=True, slots=True)
class Outcome:
    """End of a campaign.

    Attributes:
        is_reached: whether the target is reached.
        sigma: standard deviation that the target speaks of [N·m, 1, kg].
        motions: number of motions.
        seconds: motion time of all stages [s].
        sentence: why it ended.
    """

    is_reached: bool
    sigma: float
    motions: int
    seconds: float
    sentence: str


def run_campaign(
    driver: Driver,
    plan: Plan,
    target: Target,
    folder: Path,
    say: Callable[[str], None] = lambda _: None,
) -> Outcome:
    """Run a campaign, or continue it from its files.

    Args:
        driver: of the robot, which stands at the start of the motions, the home of the library.
        plan: settings.
        target: of the plan.
        folder: of the files.
        say: receives one sentence per step.

    Returns:
        How it ended.

    Raises:
        IdentificationError: the folder holds another campaign, a gate refuses a stage, or a guard
            stopped the robot.
    """
    lib = driver.lib
    state = _state(folder, lib, plan)
    logs: list[tuple[str, Path]] = []
    model: Identification | None = None
    agreement: tuple[float, ...] | None = None
    k, seconds, sigma = 0, 0.0, float("inf")
    while True:
        if sigma <= target.value or seconds + plan.seconds > plan.most_seconds:
            break
        k += 1
        motion = _designed(lib, plan, target, folder / f"motion-{k}.json", k, model)
        say(f"motion {k}: {motion.duration:g} s")
        for speed in plan.stages:
            slowed = replace(motion, duration=motion.duration * 100 / speed)
            name = f"log-{k}-{speed:g}"
            path = folder / f"{name}.npz"
            if not path.exists():
                last = logs[-1][1] if logs else None
                release = released(lib, slowed, last, model, agreement)
                _write_json(folder / f"gate-{k}-{speed:g}.json", release.to_facts())
                if not release.is_released:
                    raise IdentificationError(
                        f"motion {k} at {speed:g} % of its speed is refused: "
                        f"{'; '.join(release.reasons)}"
                    )
                _recorded(driver, slowed, path, name)
                say(f"motion {k} at {speed:g} %: released, {slowed.duration:g} s recorded")
            agreement = None if model is None else agreement_of(model, path)
            logs.append((name, path))
            seconds += slowed.duration
            model = _identified(lib, logs)
        if model is None:  # a plan has stages
            break
        write_result(model, folder / f"result-{k}", f"campaign --target {plan.target}")
        sigma = reached(target, model, motion, k)
        state["motions"] = [*state["motions"][: k - 1], {"sigma": sigma, "seconds": seconds}]
        _write_json(folder / STATE, state)
        say(f"motion {k}: σ is {target.shown(sigma)}, the target {target.shown(target.value)}")
    outcome = _outcome(sigma, k, seconds, target)
    with replacing(folder / REPORT) as file:
        file.write(_report(folder, lib, plan, target, outcome).encode())
    return outcome


def agreement_of(model: Identification, path: Path) -> tuple[float, ...]:
    """RMS of the residual of a new log over the RMS of the band that the model states, per joint.

    Args:
        model: identified without the log.
        path: of the log.

    Returns:
        (n,).

    Raises:
        IdentificationError: the model has no uncertainty.
    """
    if model.uncertainty is None:
        raise IdentificationError("expected a model with an uncertainty; identify with map")
    lib = model.lib
    # Offsets of sensors drift between logs: no offset, and a residual without its mean.
    terms = replace(model.friction, columns=FRICTION.columns[:-1])
    prepared = prepare(read_recording(path), PREPARATION, terms, lib=lib)
    samples = samples_of(prepared, lib)
    phi = model.phi[:, : len(terms.columns)]
    rest = samples.tau - torque_of(lib, samples, model.pi, phi, None)
    rest = rest - rest.mean(axis=0)
    band = np.hypot(model.uncertainty.band_of(lib, samples), model.uncertainty.noise)
    ratio = np.sqrt((rest**2).mean(axis=0) / (band**2).mean(axis=0))
    return tuple(map(float, ratio))


def _state(folder: Path, lib: Library, plan: Plan) -> dict[str, Any]:
    """Content of state.json; a new one where the folder has none."""
    described = {
        "robot": lib.name,
        "model_hash": lib.manifest.model_hash,
        "plan": asdict(plan) | {"stages": list(plan.stages)},
    }
    path = folder / STATE
    if not path.exists():
        # Motions may be given; they are read and never replaced.
        if folder.is_dir() and any(not f.match("motion-*.json") for f in folder.iterdir()):
            raise IdentificationError(
                f"'{folder}' has files and is no folder of a campaign; choose a new or empty one "
                "with --out"
            )
        state: dict[str, Any] = described | {"motions": []}
        _write_json(path, state)
        return state
    known = json_of(path)
    if not isinstance(known, dict) or any(known.get(key) != described[key] for key in described):
        raise IdentificationError(
            f"'{folder}' holds a campaign of another robot or with other settings; choose another "
            "folder with --out, or give the same settings"
        )
    return known


def _designed(
    lib: Library, plan: Plan, target: Target, path: Path, k: int, model: Identification | None
) -> Trajectory:
    """Motion K: read, or designed with what is known."""
    if path.exists():
        return read_trajectory(path, lib)
    known: Information = information(lib, payload=target.kind == "payload")
    if model is not None:
        noise, rate = torque_noise(model)
        earlier = None if target.kind == "payload" else known_before(model, lib)
        known = information(lib, noise, rate, earlier, payload=target.kind == "payload")
    designed = design(
        lib,
        duration=plan.duration,
        harmonics=HARMONICS,
        starts=1,
        seed=plan.seed + k,
        criterion="a" if target.kind == "payload" else target.kind,
        information=known,
        safety=Safety(),
        margin=0.9,
    )
    write_trajectory(designed, lib, path)
    return read_trajectory(path, lib)


def _recorded(driver: Driver, motion: Trajectory, path: Path, name: str) -> None:
    """Run one stage; a stopped one leaves its log beside, and the stage is not done."""
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


def _write_json(path: Path, facts: dict[str, Any]) -> None:
    with replacing(path) as file:
        file.write(f"{json.dumps(facts, indent=1, ensure_ascii=False)}\n".encode())


def _identified(lib: Library, logs: Sequence[tuple[str, Path]]) -> Identification:
    """Identification from all logs."""
    words: dict[str, Any] = {"method": "map", "friction_columns": FRICTION}
    if len(logs) == 1:
        return identify(read_recording(logs[0][1]), lib, preparation=PREPARATION, **words)
    named = [NamedLog(name, read_recording(path), PREPARATION) for name, path in logs]
    return identify_logs(named, lib, **words)[0]


def _outcome(sigma: float, k: int, seconds: float, target: Target) -> Outcome:
    how = "reached" if sigma <= target.value else "not reached within the time"
    known = f"σ is {target.shown(sigma)}" if k else "no motion fits into the time"
    sentence = f"the target {target.text} is {how}: {known}, {k} motions, {seconds:g} s of motion"
    return Outcome(sigma <= target.value, sigma, k, seconds, sentence)


def _report(folder: Path, lib: Library, plan: Plan, target: Target, outcome: Outcome) -> str:
    """Markdown of the whole campaign."""
    lines = [
        f"# Campaign of {lib.name}",
        "",
        f"{outcome.sentence[:1].upper()}{outcome.sentence[1:]}.",
    ]
    lines += ["", "| motion | motion time | σ | gates |", "|---|---|---|---|"]
    for k, motion in enumerate(json_of(folder / STATE)["motions"], 1):
        gates = [json_of(folder / f"gate-{k}-{speed:g}.json") for speed in plan.stages]
        passed = "released" if all(each["released"] for each in gates) else "refused"
        sigma = target.shown(motion["sigma"])
        lines.append(f"| {k} | {motion['seconds']:g} s | {sigma} | {passed} |")
    return "\n".join([*lines, ""])
