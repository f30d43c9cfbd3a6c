"""`python -m runtime predict`."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from runtime.accuracy import (
    SECONDS,
    Expected,
    Knowledge,
    Moved,
    Noise,
    Worth,
    base_names,
    expected,
    facts,
    gained,
    growth,
    moved_of,
    noise_of,
    planned,
    verdict,
)
from runtime.cli.common import Robot, console, say
from runtime.cli.options import Cutoff, Recipe, Run, read_data
from runtime.cli.prediction import (
    EarlierLogs,
    PayloadAlone,
    base_table,
    link_table,
    payload_sentence,
    torque_noise,
    torque_sentence,
    worth_table,
)
from runtime.errors import IdentificationError
from runtime.excitation.information import NOISE, RATE, information
from runtime.excitation.prediction import FRICTION, unseen_joints
from runtime.library import Array, Library, load
from runtime.prior import prior_information
from runtime.recording import Friction, read_recording
from runtime.simulation import sample_times
from runtime.trajectory_file import read_trajectory

SAME = "same"
"""Instead of a motion: this one again."""


def predict_command(
    trajectory: Annotated[
        str,
        typer.Argument(
            metavar="TRAJECTORY",
            help="A motion that excite wrote (.json), or a log as for identify.",
        ),
    ],
    robot: Robot = "fr3",
    noise: Annotated[
        str | None,
        typer.Option(
            metavar="σ",
            help="Torque noise, N·m: one number or one per joint; default from the residuals of a "
            f"log with torque, else {NOISE:g}.",
        ),
    ] = None,
    log_rate: Annotated[
        float | None,
        typer.Option(
            help=f"Rate of the log, Hz; default {RATE:g} for a motion, its own for a log."
        ),
    ] = None,
    friction: Annotated[
        str | None,
        typer.Option(
            metavar="COLUMNS",
            help="Friction estimated beside, a list as for identify, or none; default from the "
            f"recipe, else {','.join(FRICTION)}.",
        ),
    ] = None,
    payload: PayloadAlone = False,
    prior: EarlierLogs = None,
    more: Annotated[
        str | None,
        typer.Option(
            metavar=f"MOTION|{SAME}",
            help=f"What {', '.join(f'{s:g}' for s in SECONDS)} s more would improve, of the {SAME} "
            "motion again, or of another motion or log.",
        ),
    ] = None,
    recipe: Recipe = None,
    run: Run = None,
    cutoff: Cutoff = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw σ over recording time: .png, .pdf or .svg.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Everything as JSON, in SI.")] = False,
) -> None:
    r"""How well a motion will tell the parameters, before the robot moves, or while it does.

    Standard deviations by least squares and by MAP with the URDF as prior: base parameters, every
    link's mass, centre of mass and inertia, a payload of 1 kg on a known arm, and the torque of
    motions never seen. A log with torque tells its own noise, and how many samples its correlated
    residuals are worth (N_eff).

    \b
    python -m runtime predict results/motion.json --robot fr3 --noise 0.05 --log-rate 100
    python -m runtime predict log.csv --robot fr3 --more same
    python -m runtime predict log.csv --robot fr3 --more results/motion.json --plot sigma.png

    --more is a rule when to stop: go on while anything improves by more than 10 %.
    """
    lib = load(robot)
    if log_rate is not None:
        information(lib, rate=log_rate)  # raises where it is none
    options = {"recipe": recipe, "run": run, "friction": friction, "cutoff": cutoff}
    moved = _moved(lib, trajectory, log_rate, options)
    situation = _situation(lib, moved, noise, prior, payload)
    now = situation.expected()
    worths = _worths(situation, now, more, log_rate, options) if more is not None else ()
    unseen = unseen_joints(lib, lib.home)
    bands = now.torque(lib, unseen)
    if plot is not None:
        _draw(situation, more, log_rate, options, plot)
    if as_json:
        told = situation.facts() | facts(now, lib, payload)
        if not payload:
            told["torque_of_unseen_motions"] = bands.tolist()
        if worths:
            told["more"] = [
                {"seconds": w.seconds, "motion": w.motion, "gains": dict(w.gains)} for w in worths
            ]
            told["verdict"] = verdict(worths)
        print(json.dumps(told, indent=1, ensure_ascii=False, allow_nan=False))
        return
    say(situation.sentence())
    if not payload:
        console.print(base_table(now, lib))
        console.print(link_table(now, lib))
        say(torque_sentence(bands))
    say(payload_sentence(now, payload))
    if worths:
        console.print(worth_table(worths))
        say(verdict(worths))
    if plot is not None:
        say(f"plot: {plot}")


@dataclass(frozen=True, slots=True)
class _Situation:
    """A motion, its noise, and what is known before."""

    lib: Library
    moved: Moved
    noise: Array
    unit: float
    from_residuals: bool
    known: Knowledge

    def expected(self, more: Moved | None = None, seconds: float = 0.0) -> Expected:
        """σ of the motion, and of some more seconds of another one."""
        statistics = self.moved.statistics(self.lib, self.noise)
        if more is not None:
            statistics = statistics.merged(more.statistics(self.lib, self.noise, seconds))
        found = expected(self.lib, statistics, self.known, self.unit, self.moved.columns)
        if self.known.payload_only and found.payload is None:
            raise IdentificationError(
                f"'{self.moved.name}' does not tell all ten parameters of a payload; give a motion "
                "that turns the last link about all axes (excite --payload designs one)"
            )
        return found

    def sentence(self) -> str:
        """What is taken for granted."""
        low, high = self.noise.min(), self.noise.max()
        size = f"{low:.3g}" + ("" if low == high else f"–{high:.3g}")
        origin = " (RMS of the log's residuals)" if self.from_residuals else ""
        count = len(self.moved.samples)
        worth = f", worth {count / self.unit:.0f} independent ones" if self.unit > 1 else ""
        earlier = ", earlier logs counted" if self.known.earlier is not None else ""
        beside = ", ".join(self.moved.columns) or "none"
        return (
            f"{self.moved.name}: {self.moved.seconds:.3g} s, {count} samples{worth}; torque noise "
            f"{size} N·m{origin}; friction beside: {beside}{earlier}"
        )

    def facts(self) -> dict[str, object]:
        """The same for JSON files."""
        count = len(self.moved.samples)
        return {
            "robot": self.lib.name,
            "motion": self.moved.name,
            "seconds": self.moved.seconds,
            "rate_hz": self.moved.rate,
            "n_samples": count,
            "n_eff": count / self.unit,
            "torque_noise": self.noise.tolist(),
            "noise_from_residuals": self.from_residuals,
            "friction": list(self.moved.columns),
            "earlier_logs_count": self.known.earlier is not None,
        }


def _situation(
    lib: Library, moved: Moved, noise: str | None, prior: list[str] | None, payload: bool
) -> _Situation:
    given = None if noise is None else information(lib, torque_noise(noise, lib.n_joints)).noise
    own: Noise | None = noise_of(lib, moved)
    known = replace(Knowledge.of(lib), payload_only=payload)
    if own is not None:
        known = replace(known, pi=own.pi)
    sigma = given if given is not None else own.sigma if own is not None else None
    if sigma is None:
        sigma = np.full(lib.n_joints, NOISE)
    if prior:
        logs = [read_recording(log, joints=lib.joint_names) for log in prior]
        known = replace(known, earlier=prior_information(lib, logs, sigma, moved.columns))
    unit = own.inflation if own is not None else 1.0
    return _Situation(lib, moved, sigma, unit, given is None and own is not None, known)


def _moved(
    lib: Library,
    source: str,
    rate: float | None,
    options: dict[str, str | None],
    terms: Friction | None = None,
) -> Moved:
    """A trajectory, sampled, or a log, prepared; `terms` are those of the motion before."""
    if Path(source).suffix == ".json":
        found = read_trajectory(Path(source), lib)
        t = sample_times(found.duration, rate or RATE)
        recording = planned(found, t, lib, Path(source).stem)
        return moved_of(recording, lib, None, terms or _friction(options["friction"]))
    data = read_data(lib, source, coulomb_speed=None, rate=rate, split=None, **options)  # type: ignore[arg-type]
    terms = terms or data.friction or _friction(None)
    return moved_of(data.recording, lib, data.preparation, terms)


def _friction(text: str | None) -> Friction:
    if text is None:
        return Friction(FRICTION)
    return Friction(() if text == "none" else tuple(text.split(",")))


def _further(
    situation: _Situation, more: str, rate: float | None, options: dict[str, str | None]
) -> Moved:
    """The motion that goes on, with the friction of the one before."""
    moved = situation.moved
    if more == SAME:
        return moved
    if rate is None and Path(more).suffix == ".json":
        rate = moved.rate
    own = options | {"recipe": None, "run": None, "friction": None}
    found = _moved(situation.lib, more, rate, own, moved.terms)
    found.require_columns(moved.columns)
    return found


def _worths(
    situation: _Situation,
    now: Expected,
    more: str,
    rate: float | None,
    options: dict[str, str | None],
) -> tuple[Worth, ...]:
    further, lib = _further(situation, more, rate, options), situation.lib
    name = "the same motion" if more == SAME else further.name
    only = situation.known.payload_only
    before = now.by_name(lib, only)
    return tuple(
        gained(before, situation.expected(further, s).by_name(lib, only), s, name) for s in SECONDS
    )


def _draw(
    situation: _Situation,
    more: str | None,
    rate: float | None,
    options: dict[str, str | None],
    path: Path,
) -> None:
    from runtime.report.growth import draw_growth  # matplotlib loads slowly

    lib = situation.lib
    further = None if more in {None, SAME} else _further(situation, str(more), rate, options)
    until = SECONDS[-1] if more is not None else 0.0
    common = lib, situation.moved, situation.noise, situation.known, situation.unit
    draw_growth(growth(*common, base_names(lib), more=further, until=until), path)
