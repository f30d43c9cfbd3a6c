"""`symgen predict`."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from runtime.campaign.shortest_session import ModelError
from runtime.cli.common import counting, open_robot, state
from runtime.cli.excite_settings import (
    NOISE_HELP,
    EarlierLogs,
    PayloadOnly,
    TorqueNoise,
    friction_columns,
    planned_noise,
    require_gain_error,
    torque_sentence,
)
from runtime.cli.log_options import Cutoff, LogChoices, Rate, bundled_logs, shown_progress
from runtime.common import settings
from runtime.common.files import json_text, require_unused
from runtime.common.terminal import completing, say, show
from runtime.errors import IdentificationError
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.excitation.search.criteria import unseen_joints
from runtime.excitation.search.information import FRICTION, NOISE, RATE, information
from runtime.identification.expected_accuracy import expected as accuracy
from runtime.identification.expected_accuracy import planned_samples
from runtime.identification.expected_accuracy.expected import SECONDS, Expected
from runtime.identification.expected_accuracy.planned_samples import MotionSamples
from runtime.identification.identify import identify
from runtime.identification.prepared_log import prepared_log
from runtime.identification.settings import Settings
from runtime.library import Array, Library
from runtime.library.manifest import common_unit, torque_units
from runtime.library.parameters import links, mass
from runtime.outputs.report import canvas
from runtime.recording import Friction, read_recording
from runtime.recording.free_base import read_free_base
from runtime.recording.settings import COLUMNS
from runtime.simulation import sample_times

MOST_ROWS = 300_000  # most rows of a planned log; each takes 1 kB with the regressor of its blocks
DASHES = "-", "--", ":"  # of the links, when all colours are taken
SAME = "same"  # value of --more: the same motion again


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictSettings(LogChoices):
    """Settings of `symgen predict`."""

    options = "robot noise more recipe cutoff overwrite as_json"
    trajectory: str = settings.argument_field(
        metavar="MOTION",
        autocompletion=bundled_logs,
        help="A motion written by excite (.json), or a log.",
    )
    noise: str | None = settings.model_field(
        metavar="σ|LOG",
        help=f"{NOISE_HELP}; default from the residuals of MOTION where it is a log "
        f"with torque, else {NOISE:g}.",
    )
    log_rate: float | None = settings.data_field(
        help="Rate at which the robot will record a planned motion, Hz; default "
        f"{RATE:g}, after a log the rate of its rows."
    )
    friction: str | None = settings.model_field(
        metavar="COLUMNS",
        autocompletion=completing(COLUMNS),
        help="Friction columns that are estimated too, with commas, or none; default from the "
        f"recipe, else {','.join(FRICTION)}.",
    )
    payload_only: PayloadOnly = False
    earlier_log: EarlierLogs = None
    gain_error: float | None = settings.model_field(
        metavar="SHARE",
        help="Standard deviation of the torque gain of every joint, relative to one, for the "
        f"σ of predicted torque; residuals hardly show it. Default {ModelError().gain:g}.",
    )
    more: str | None = settings.method_field(
        metavar=f"MOTION|{SAME}",
        help=f"Show what {', '.join(f'{s:g}' for s in SECONDS)} s of recording would add, "
        f"with the {SAME} motion again or with another motion or log.",
    )
    cutoff: Cutoff = None
    rate: Rate = None
    plot: Path | None = settings.output_field(
        metavar="FILE", help="Draw σ over the recording time; .png, .pdf or .svg."
    )
    as_json: bool = settings.output_field(False, "--json", help="Print JSON in SI units instead.")


def predict_command(given: PredictSettings) -> None:
    r"""Predict the accuracy that a motion or a log allows.

    \b
    symgen predict fr3_simulated
    symgen predict results/motion.json --robot fr3 --noise 0.05 --settings log_rate=100
    symgen predict log.csv --robot fr3 --more same
    symgen predict log.csv --robot fr3 --more results/motion.json --settings plot=sigma.png

    Printed are standard deviations by least squares and by MAP with the URDF as prior: of the base
    parameters, of mass, centre of mass and inertia of every link, of a payload of 1 kg on a known
    arm, and of the torque of motions that are not in the log.

    A log with torque gives its noise by its residuals, and the effective sample size N_eff of these
    correlated residuals. With --more, record on while any σ improves by more than 10 %.
    """
    lib = open_robot(given.robot, given.yes, takes_free_base=True)
    if lib.manifest.floating:
        _predict_walk(lib, given)
        return
    require_unused([given.plot] if given.plot else [], given.overwrite, "the setting plot")
    gain_error = _gain_error(given)
    if given.log_rate is not None:
        information(lib, rate=given.log_rate)  # raises where the rate is out of range
    _require_rates_apply(given)
    moved = _moved(given, lib)
    situation = situation_of(lib, moved, given, gain_error)
    now = situation.expected()
    further = moved
    if given.more not in {None, SAME}:  # the motion that goes on, with the friction of this one
        rate = given.log_rate or moved.rate
        other = replace(given, trajectory=given.more, log_rate=rate, recipe=None, run=None)
        further = _moved(other, lib, moved.terms)
        further.require_columns(moved.columns)
    steps = situation.steps(now, further) if given.more else ()
    if given.plot is not None:
        draw_growth(situation, further, SECONDS[-1] if given.more else 0.0, given.plot)
    if given.as_json:
        print(json_text(situation.facts(now) | facts_of_steps(steps)), end="")
        return
    situation.show(now)
    _show_steps(steps)
    if given.plot is not None:
        say(f"plot: {given.plot}")


def draw_growth(now: "Situation", further: MotionSamples, until: float, path: Path) -> None:
    """Write two panels over time: σ of every mass, and σ of the worst base parameter."""
    lib, moved = now.lib, now.moved
    more = None if further is moved else further
    known = lib, moved, now.noise, now.known, now.unit
    seconds, sigmas = accuracy.growth(*known, more=more, until=until)
    bodies = [mass(links(each.pi)) for each in sigmas]
    payload = np.array([np.inf if x.payload is None else mass(x.payload.pi) for x in sigmas])
    last = accuracy.base_names(lib)[int(np.argmax(sigmas[-1].relative))]
    with canvas.picture(path, (10.0, 4.6), dpi=130) as figure:
        masses, worst = figure.subplots(1, 2, sharex=True)
        for k, (name, sigma) in enumerate(zip(lib.link_names, np.transpose(bodies), strict=True)):
            style = DASHES[k // len(canvas.CYCLE) % len(DASHES)]
            colour = canvas.CYCLE[k % len(canvas.CYCLE)]
            masses.plot(seconds, 1e3 * sigma, color=colour, linestyle=style, label=name)
        is_known = np.isfinite(payload)
        if is_known.any():
            masses.plot(
                seconds[is_known],
                1e3 * payload[is_known],
                color=canvas.INK,
                linewidth=2.0,
                label="payload of 1 kg on a known arm",
            )
        masses.set_title("σ of masses [g], MAP with the URDF as prior")
        worst.plot(seconds, [100 * each.relative.max() for each in sigmas], color=canvas.INK)
        worst.set_title(f"largest σ of a base parameter [% of its value]; at the end: {last}")
        for axis in (masses, worst):
            axis.set_yscale("log")
            axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axis.margins(x=0)
            axis.set_xlabel("recording time [s]")
            if seconds[-1] > moved.seconds:
                span = moved.seconds, float(seconds[-1])
                axis.axvspan(*span, color=canvas.GREY, alpha=0.25, linewidth=0)
        figure.legend(*masses.get_legend_handles_labels(), loc="outside lower left", ncols=4)
        grey = f"; grey: {now.name_of(further)}" if seconds[-1] > moved.seconds else ""
        canvas.heading(figure, f"{lib.name}, {moved.name}, {moved.seconds:.3g} s{grey}")


OF_WALK = ("trajectory", "robot", "yes", "friction", "cutoff", "more", "as_json")
"""Parameters of the command that apply to a robot with a free base."""


def _predict_walk(lib: Library, given: PredictSettings) -> None:
    """Print the accuracy that `identify` reaches with a log of a robot with a free base."""
    unused = given.stated_beyond(OF_WALK)
    if unused or given.more not in {None, SAME}:
        raise IdentificationError(
            f"{unused[0] if unused else '--more with another log'} does not apply to a robot with "
            f"a free base; leave it out{'' if unused else f', or give --more {SAME}'}"
        )
    log = read_free_base(given.trajectory)
    result = identify(log, lib, cutoff=given.cutoff, friction=given.friction)
    now, names = accuracy.expected_of_walk(result), accuracy.named_of_walk
    before = names(result, now)
    later = {s: accuracy.expected_of_walk(result, s) for s in (SECONDS if given.more else ())}
    pairs = ((s, names(result, sigma)) for s, sigma in later.items())
    steps = tuple(accuracy.gained(before, after, s, "the same motion") for s, after in pairs)
    columns, total = list(result.friction.columns), before[accuracy.TOTAL_MASS]
    if given.as_json:
        figures = {"robot": lib.name, "motion": log.name, "seconds": result.evidence.seconds}
        known = figures | {"friction": columns, accuracy.TOTAL_MASS: total}
        print(json_text(known | accuracy.facts(now, lib) | facts_of_steps(steps)), end="")
        return
    say(
        f"{log.name}: {result.evidence.seconds:.3g} s are fitted, friction columns: "
        f"{', '.join(columns) or 'none'}; σ contain offsets of the contact sensors"
    )
    show(accuracy.base_table(now, lib))
    show(accuracy.link_table(now, lib))
    say(f"total mass to ±{1000 * total:.1f} g")
    _show_steps(steps)


_MOMENTUM = "; rows of momentum, which show more than the rows of energy that the recipe states"


@dataclass(frozen=True, slots=True)
class Situation:
    """A motion or log, the noise of its torque, and the knowledge before it."""

    lib: Library  # library of the robot
    moved: MotionSamples  # samples of the motion
    noise: Array  # σ of the torque, (n,) N·m
    unit: float  # samples per independent sample, at least 1
    from_residuals: bool  # whether `noise` is from the residuals of the motion itself
    planned: TorqueNoise  # noise that was given, or that of a planned motion
    known: accuracy.Knowledge  # prior and earlier logs
    gain_error: float  # σ of the torque gain of every joint, relative to one

    def expected(self, more: MotionSamples | None = None, seconds: float = 0.0) -> Expected:
        """Expected accuracy of the motion, and of some seconds of another motion after it."""
        statistics = self.moved.statistics(self.lib, self.noise)
        if more is not None:
            statistics = statistics.merged(more.statistics(self.lib, self.noise, seconds))
        sigmas = accuracy.expected(self.lib, statistics, self.known, self.unit, self.moved.columns)
        if self.known.payload_only and sigmas.payload is None:
            raise IdentificationError(
                f"'{self.moved.name}' does not determine all ten parameters of a payload; give a "
                "motion that turns the last link about all axes (excite --settings "
                "payload_only=true designs one)"
            )
        return sigmas

    def sentence(self) -> str:
        """Sentence on duration, samples, noise and unknowns."""
        low, high = self.noise.min(), self.noise.max()
        size = f"{low:.3g}" + ("" if low == high else f"–{high:.3g}")
        origin = " (RMS of the log's residuals)" if self.from_residuals else ""
        if self.planned.log is not None and not self.from_residuals:
            origin = f" (RMS of the residuals of {self.planned.log})"
        count = len(self.moved.samples)
        effective = (
            f", as good as {count / self.unit:.0f} independent ones" if self.unit > 1 else ""
        )
        earlier = ", earlier logs counted" if self.known.earlier is not None else ""
        beside = ", ".join(self.moved.columns) or "none"
        rows = _MOMENTUM if self.moved.replaces_power else ""
        unit = common_unit(torque_units(self.lib.manifest))
        return (
            f"{self.moved.name}: {self.moved.seconds:.3g} s, {count} samples{effective}; torque "
            f"noise {size} {unit}{origin}; friction columns: {beside}{earlier}{rows}"
        )

    def facts(self, now: Expected) -> dict[str, object]:
        """The same and the accuracy, JSON-ready."""
        count, alone = len(self.moved.samples), self.known.payload_only
        figures = {
            "robot": self.lib.name,
            "motion": self.moved.name,
            "seconds": self.moved.seconds,
            "rate_hz": self.moved.rate,
            "n_samples": count,
            "n_eff": count / self.unit,
            "torque_noise": self.noise.tolist(),
            "noise_from_residuals": self.from_residuals,
            "noise_log": None if self.from_residuals else self.planned.log,
            "friction": list(self.moved.columns),
            "earlier_logs_count": self.known.earlier is not None,
        }
        figures |= accuracy.facts(now, self.lib, alone)
        if not alone:
            torque, whole = self._unseen(now)
            figures["torque_of_unseen_motions"] = torque.tolist()
            figures["gain_error"] = self.gain_error
            figures["torque_of_unseen_motions_with_gains"] = whole.tolist()
        return figures

    def show(self, now: Expected) -> None:
        """Print the accuracy."""
        lib, alone = self.lib, self.known.payload_only
        say(self.sentence())
        if not alone:
            show(accuracy.base_table(now, lib))
            show(accuracy.link_table(now, lib))
            torque, whole = self._unseen(now)
            units = torque_units(lib.manifest)
            say(torque_sentence(torque, units))
            if self.gain_error:
                say(torque_sentence(whole, units, self.gain_error))
        say(accuracy.payload_sentence(now, alone))
        if not self.from_residuals and self.planned.sentence():
            say(self.planned.sentence())

    def steps(self, now: Expected, further: MotionSamples) -> tuple[accuracy.GainOfRecording, ...]:
        """Gains of recording on, with a further motion."""
        lib, alone, name = self.lib, self.known.payload_only, self.name_of(further)
        before = now.by_name(lib, alone)
        later = (self.expected(further, s).by_name(lib, alone) for s in SECONDS)
        return tuple(
            accuracy.gained(before, after, s, name) for s, after in zip(SECONDS, later, strict=True)
        )

    def name_of(self, further: MotionSamples) -> str:
        """Name of the motion that follows."""
        return "the same motion" if further is self.moved else further.name

    def _unseen(self, now: Expected) -> tuple[Array, Array]:
        """σ of the torque of motions never seen, per joint, without and with errors of gains."""
        lib = self.lib
        unseen = unseen_joints(lib, lib.home)
        torque = accuracy.unseen_torque(lib.base_matrix @ now.root, unseen)
        slopes = accuracy.gain_slopes(lib, self.moved, self.noise, self.known, self.unit)
        by_gains = accuracy.unseen_torque(self.gain_error * (lib.base_matrix @ slopes), unseen)
        return torque, np.hypot(torque, by_gains)


def situation_of(
    lib: Library, moved: MotionSamples, given: PredictSettings, gain_error: float
) -> Situation:
    """Situation of the options; the noise is by default that of the log's residuals."""
    planned = TorqueNoise(np.full(lib.n_joints, NOISE))
    if given.noise is not None:
        planned = planned_noise(lib, given.noise, moved.columns)
    sigma, unit = planned.sigma, planned.rows_per_independent(moved.rate)
    known = replace(accuracy.Knowledge.of(lib), payload_only=given.payload_only)
    residual = planned_samples.noise_of(lib, moved)
    if residual is not None:
        error = accuracy.error_of_fit(lib, moved.samples, residual.fit)
        known = replace(known, pi=residual.fit.pi, error=error)
        sigma = residual.sigma if given.noise is None else sigma
        unit = residual.inflation if planned.log is None else unit
    if given.earlier_log:
        logs = [read_recording(log, joints=lib.joint_names) for log in given.earlier_log]
        earlier = planned_samples.information_of_logs(lib, logs, sigma, moved.columns)
        known = replace(known, earlier=earlier)
    from_residuals = residual is not None and given.noise is None
    return Situation(lib, moved, sigma, unit, from_residuals, planned, known, gain_error)


def facts_of_steps(steps: tuple[accuracy.GainOfRecording, ...]) -> dict[str, object]:
    """Gains of recording on as JSON-ready values; none without them."""
    if not steps:
        return {}
    return {"more": [asdict(step) for step in steps], "verdict": accuracy.verdict(steps)}


def _show_steps(steps: tuple[accuracy.GainOfRecording, ...]) -> None:
    if steps:
        show(accuracy.gain_table(steps))
        say(accuracy.verdict(steps))


def _gain_error(given: PredictSettings) -> float:
    if given.gain_error is None:
        return ModelError().gain
    if given.payload_only:
        raise IdentificationError(
            "the setting gain_error changes the σ of predicted torque, which --settings "
            "payload_only=true does not print; leave out one of them"
        )
    require_gain_error(given.gain_error)
    return given.gain_error


def _moved(given: PredictSettings, lib: Library, terms: Friction | None = None) -> MotionSamples:
    """A trajectory, sampled, or a log, prepared; `terms` are those of the motion before."""
    source = given.trajectory
    if _is_motion(source):
        motion, rate = read_trajectory(Path(source), lib), given.log_rate or RATE
        t = sample_times(motion.duration, rate)
        if len(t) > MOST_ROWS:
            raise IdentificationError(
                f"a planned log has at most {MOST_ROWS:,} rows, got {len(t):,} by the setting "
                f"log_rate={rate:g}; lower it: σ falls with the root of the rate"
            )
        recording = planned_samples.planned_recording(motion, t, lib, Path(source).stem)
        names = FRICTION if given.friction is None else friction_columns(given.friction)
        return planned_samples.motion_samples_of(recording, lib, None, terms or Friction(names))
    friction = None if terms else given.friction
    wanted = Settings(friction=friction, cutoff=given.cutoff, rate=given.rate)
    with counting(state()) as bar:
        log = read_recording(source, given.recipe, given.run, lib.joint_names)
        data = prepared_log(log, lib, wanted, progress=shown_progress(bar, "predict", lib.name))
    terms = terms or data.friction or Friction(FRICTION)
    return planned_samples.motion_samples_of(data.recording, lib, data.preparation, terms)


def _is_motion(source: str) -> bool:
    return Path(source).suffix == ".json"


def _require_rates_apply(given: PredictSettings) -> None:
    """Refuse a rate that no motion or no log would take."""
    sources = [each for each in (given.trajectory, given.more) if each and each != SAME]
    if given.log_rate is not None and not any(map(_is_motion, sources)):
        raise IdentificationError(
            "the setting log_rate is the rate at which a planned motion (.json) will be recorded, "
            f"but '{sources[0]}' is a log; give --settings rate=HZ to decimate it"
        )
    if given.rate is not None and all(map(_is_motion, sources)):
        raise IdentificationError(
            f"the setting rate is the rate to which a log is decimated, but '{sources[0]}' is a "
            "planned motion; give --settings log_rate=NUMBER"
        )
