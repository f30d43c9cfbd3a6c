"""Settings of `symgen excite`, and noise of a log that is not yet recorded.

The noise of --noise is given as numbers, or as a log whose residuals are its noise:

    σ_j = RMS of the residuals of joint j,    T = (N / N_eff) / f

They contain the model error, friction beyond the columns, gains and delays, and are autocorrelated,
so that only one row per T counts as independent. Numbers are independent noise alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from runtime.campaign.shortest_session import target_of
from runtime.cli.common import numbers_option, sentences_of
from runtime.cli.motion_limits import LimitChoices
from runtime.cli.motion_output import EXPORT_MARGIN, MotionChoices
from runtime.common.settings import (
    data_field,
    data_option,
    method_field,
    model_field,
    model_option,
    output_field,
)
from runtime.common.terminal import completing
from runtime.common.texts import numbers_of
from runtime.common.threads import cores
from runtime.errors import IdentificationError, RuntimeFault
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import BASES, basis_of
from runtime.excitation.search.criteria import CRITERIA, criterion_of
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import (
    FRICTION,
    Information,
    NoiseSpectrum,
    information,
    spectrum_of,
)
from runtime.identification.expected_accuracy.planned_samples import (
    information_of_logs,
    motion_samples_of,
    noise_of,
)
from runtime.identification.prepared_log import prepared_log
from runtime.identification.settings import NO_FRICTION, Settings
from runtime.library import Array, Library
from runtime.library.manifest import listed_torques
from runtime.recording import Friction, read_recording
from runtime.recording.settings import COLUMNS

NOISE_HELP = (
    "Torque noise: its standard deviation in N·m or N, one number or one per joint with commas, "
    "without model error; or a log of this robot, whose residuals contain friction beyond the "
    "columns, gains and delays, with their autocorrelation"
)
WHITE, COLOURED = "white", "coloured"
NoiseModel = Annotated[
    str,
    model_option(
        metavar="white|coloured",
        help="Spectrum of the noise of --noise LOG in the criteria: white counts autocorrelated "
        "rows as fewer; coloured weights every frequency of a motion by the noise of the log, "
        "which contains what friction columns, gains and delays leave.",
    ),
]
Cutoff = Annotated[
    float | None,
    typer.Option(
        metavar="HZ",
        help="Cut-off of the low-pass that the log of the motion will pass: what the motion has "
        "beyond it does not count in the criteria.",
    ),
]
EarlierLogs = Annotated[
    list[str] | None,
    data_option(
        metavar="LOG", help="A log that is recorded already; its information is added. Repeatable."
    ),
]
PayloadOnly = Annotated[
    bool,
    typer.Option(help="Only the ten parameters of the last link are unknown; the arm is known."),
]
HARMONICS = 8
"""Default number of harmonics: logs of virtual arms give smaller errors than with 5, and the same
as with 10 (`scripts/bench_excitation --designs`)."""
DOCUMENT_HARMONICS = DesignSettings().harmonics  # that of the document's problem
HARMONICS_HELP = (
    f"Number M of harmonics or splines per joint; default {HARMONICS}, with --settings "
    f"document=true {DOCUMENT_HARMONICS}."
)
MARGIN_HELP = (
    "Share of every limit that the motion may use, 0 to 1; distances and the box have margins in "
    f"m. Default {EXPORT_MARGIN:g} with --export, which leaves the rest to the robot's controller, "
    "else 1."
)
STARTS_FOR_PROCESSES = {True: 10, False: 4}
"""Least number of starts for which several processes are faster than one, by document mode.

A process takes two seconds to begin, as long as one start with all limits; a start in document mode
takes a third of that.
"""
POSES = 12  # default number of poses
OF_LIMITS = {"from_pose", *(field.name for field in fields(LimitChoices))} - {
    *("unchecked", "robot", "yes")
}
"""Choices that the document's problem lacks."""
OF_POSES = (OF_LIMITS - {"from_pose"}) | {  # choices of poses at rest
    *("static", "poses", "robot", "yes", "starts", "seed", "out", "noise", "margin", "overwrite")
}
OF_ONE_MOTION = ("document", "static", "until", "export", "from_pose", "returns", "pictures")
"""Choices that several motions do not have."""
OF_TARGET = (  # choices that --until makes
    *("duration", "criterion", "document", "static", "payload_only", "noise_model", "cutoff"),
)


@dataclass(frozen=True, slots=True)
class TorqueNoise:
    """Noise of the torque of a planned motion."""

    sigma: Array  # (n,) N·m or N
    spacing: float = 0.0  # time between independent rows, s; 0 where all rows are independent
    log: str | None = None  # name of the log that it is from; None for numbers
    spectrum: NoiseSpectrum | None = None  # of a log's noise, for noise_model=coloured

    def rows_per_independent(self, rate: float) -> float:
        """Rows that count as one independent row."""
        return max(1.0, rate * self.spacing)

    def sentence(self) -> str:
        """Sentence on what σ does not contain; empty for the noise of a log."""
        if self.log is not None:
            return ""
        return (
            "note: σ counts independent torque noise alone; friction beyond the columns, gains and "
            "delays make real errors larger. --noise LOG, a log of this robot, counts its residuals"
        )


def planned_noise(
    lib: Library, text: str, friction: tuple[str, ...] | None = None, model: str = WHITE
) -> TorqueNoise:
    """Noise from the value of --noise."""
    if model not in (WHITE, COLOURED):
        raise IdentificationError(
            f"expected --settings noise_model={WHITE} or {COLOURED}, got '{model:.40}'; correct it"
        )
    if numbers := numbers_of(text):
        if model == COLOURED:
            raise IdentificationError(
                f"--settings noise_model={COLOURED} takes the spectrum from a log; give --noise LOG"
            )
        count = lib.n_joints if len(numbers) > 1 else 1
        sigma = np.array(numbers_option(text, count, "--noise"))
        return TorqueNoise(information(lib, np.broadcast_to(sigma, lib.n_joints)).noise)
    names = FRICTION if friction is None else friction
    log = read_recording(text, joints=lib.joint_names)
    data = prepared_log(log, lib, Settings(friction=names or NO_FRICTION))
    moved = motion_samples_of(data.recording, lib, data.preparation, Friction(names))
    noise = noise_of(lib, moved)
    if noise is None:
        raise IdentificationError(
            f"--noise needs a log with measured torque and more rows than unknowns, got '{text}'; "
            "give another log, or the standard deviation in N·m or N"
        )
    if model == WHITE:
        return TorqueNoise(noise.sigma, noise.inflation / moved.rate, moved.name)
    steps = data.preparation or data.recording.preparation
    spectrum = spectrum_of(noise.rest, moved.rate, steps.cutoff_hz)
    return TorqueNoise(noise.sigma, noise.repeated / moved.rate, moved.name, spectrum)


def friction_columns(text: str) -> tuple[str, ...]:
    """Friction columns from --friction."""
    words = tuple(text.split(","))
    if any(word.replace(".", "", 1).strip("+- ").isdecimal() for word in words):
        raise IdentificationError(
            f"--friction needs names of columns with commas, or none, got '{text}'; the setting "
            "viscous and the setting coulomb of excite take numbers"
        )
    return () if text == "none" else words


def require_gain_error(gain_error: float) -> None:
    """Check a value of the setting gain_error."""
    if not 0 <= gain_error < 1:
        raise RuntimeFault(
            f"the setting gain_error is a share of one, such as 0.005, got {gain_error:g}"
        )


def torque_sentence(bands: Array, units: Sequence[str], gain_error: float = 0.0) -> str:
    """Sentence on the σ of predicted torque for motions that are not in the log."""
    sigmas = listed_torques(1000 * bands, units, ".2f", "m")
    if gain_error:
        off = f"{100 * gain_error:g} % off (the setting gain_error), which residuals hardly show"
        return f"with torque gains that may be {off}: {sigmas}"
    return f"expected σ of the predicted torque, joint by joint: {sigmas}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExciteSettings(MotionChoices):
    """Settings of `symgen excite`."""

    options = (
        "robot duration budget criterion noise table box obstacles carry from_pose returns "
        "until export speed out"
    )
    duration: float = method_field(10.0, help="Duration t_f of the motion, s.")
    harmonics: int | None = method_field(help=HARMONICS_HELP)
    starts: int = method_field(5, help="Number of searches; the best one is kept.")
    budget: float | None = method_field(
        metavar="SECONDS",
        help="Time for searches: after the first, a further one is made only if the mean time "
        "per search still fits. The best is then finished and certified. The result depends on "
        "the speed of the machine.",
    )
    processes: int | None = method_field(
        help="Number of parallel processes; default one per core, 1 for few starts (fewer than "
        "4, with --settings document=true 10)."
    )
    scheduler: str | None = method_field(
        metavar="tcp://HOST:PORT",
        help="Search on the workers of this dask cluster instead (pip install "
        "'symgen\\[cluster]'). Each worker loads the robot's folder, so it needs the same file "
        "system.",
    )
    static: bool = method_field(
        False,
        help="Poses at rest in place of a motion, for the gravity parameters of robots whose "
        "torque is coarse: each is reached from both sides, so that Coulomb friction cancels.",
    )
    poses: int | None = method_field(
        metavar="K", help=f"Number of poses of --settings static=true; default {POSES}."
    )
    out: Path | None = output_field(
        metavar="FILE", help="JSON of the motion; default results/ROBOT-excite.json."
    )
    document: bool = method_field(
        False,
        help="Problem of the document: criterion cond, limits of position, velocity and "
        "acceleration only. Such a motion can hit the table that an FR3 stands on.",
    )
    criterion: str | None = method_field(
        autocompletion=completing(CRITERIA),
        help=f"Quantity to minimise; default mixed. {sentences_of(CRITERIA)}.",
    )
    basis: str = method_field(
        "cosine",
        autocompletion=completing(BASES),
        help=f"Functions of the motion. {sentences_of(BASES)}.",
    )
    zero_jerk: bool = method_field(False, help="Begin and end with zero jerk too.")
    noise: str = model_field("0.05", metavar="σ|LOG", help=f"{NOISE_HELP}.")
    noise_model: NoiseModel = WHITE
    cutoff: Cutoff = None
    log_rate: float = data_field(100.0, help="Rate at which the robot will record the motion, Hz.")
    friction: str | None = model_field(
        metavar="COLUMNS",
        autocompletion=completing(COLUMNS),
        help="Friction columns that are estimated too, with commas, or none; default "
        f"{','.join(FRICTION)}, with --settings payload_only=true offset. All criteria but the "
        "document's cond count them.",
    )
    earlier_log: EarlierLogs = None
    payload_only: PayloadOnly = False
    home: str | None = model_field(
        metavar="Q",
        help="Start and end position, one number per joint with commas, rad or m; default the "
        "home of the robot.",
    )
    margin: float | None = method_field(help=MARGIN_HELP)
    pictures: bool = output_field(
        False,
        help="Write PNG files beside the JSON: motion and torque of every joint with limits, "
        "velocity over position (-speed), path of the tip and distances (-space).",
    )
    until: str | None = method_field(
        metavar="TARGET",
        help='Find the shortest session with an expected standard deviation: "payload 5 g", '
        "v=100mNm (torque of motions never seen) or a=10% (base parameters over their sizes). "
        "It counts noise, friction, offsets, gains and model error. --duration and --criterion "
        "follow.",
    )
    motions: int = method_field(
        1,
        metavar="K",
        help="Number of motions that share --duration, each designed with what those before it "
        "determine; written as NAME-1.json to NAME-K.json. symgen approach exports them.",
        min=1,
    )
    gain_error: float = model_field(
        0.005,
        metavar="SHARE",
        help="Standard deviation of the torque gain of every joint in --until, relative to one.",
    )

    @property
    def search(self) -> dict[str, Any]:
        """Time, processes and cluster of the searches."""
        several = self.starts >= STARTS_FOR_PROCESSES[self.document]
        count = self.processes if self.processes is not None else cores() if several else 1
        return {"budget": self.budget, "processes": count, "scheduler": self.scheduler}

    @property
    def functions(self) -> int:
        """Number of harmonics or splines per joint."""
        usual = DOCUMENT_HARMONICS if self.document else HARMONICS
        return usual if self.harmonics is None else self.harmonics

    @property
    def share(self) -> float:
        """Share of every limit that a design may use."""
        if self.margin is not None:
            return self.margin
        return EXPORT_MARGIN if self.export else 1.0

    @property
    def aim(self) -> str | None:
        """Kind of the target of --until."""
        return None if self.until is None else target_of(self.until).kind

    def designed(
        self, lib: Library, safety: Safety | None
    ) -> tuple[DesignSettings, Information, str]:
        """Settings of Python within these limits, knowledge of the unknowns, and a note on it."""
        alone = self.payload_only or self.aim == "payload"
        usual = "cond" if self.document else "a" if alone and self.aim else self.aim or "mixed"
        wanted = self.criterion or usual
        home = None
        if self.home is not None:
            home = np.array(numbers_option(self.home, lib.n_joints, "the setting home"))
        planned, note = self.planned(lib, alone)
        is_informed = criterion_of(wanted).needs_information or bool(self.earlier_log) or alone
        if planned.spectrum is not None and not is_informed:
            raise IdentificationError(
                f"criterion {wanted} counts neither noise nor filter; leave out the settings "
                "cutoff and noise_model, or give another --criterion such as v"
            )
        settings = DesignSettings(
            duration=self.duration,
            harmonics=self.functions,
            starts=self.starts,
            seed=self.seed,
            home=home,
            criterion=wanted,
            basis=basis_of(self.basis, self.zero_jerk),
            information=planned if is_informed else None,
            safety=safety,
            margin=self.share,
        )
        return settings, planned, note

    def planned(self, lib: Library, alone: bool) -> tuple[Information, str]:
        """Noise, rate, earlier logs and unknowns of the log of the motion, and a note on them."""
        rate = self.log_rate
        information(lib, rate=rate)  # raises where the rate is out of range
        columns = None if self.friction is None else friction_columns(self.friction)
        torque = planned_noise(lib, self.noise, columns, self.noise_model)
        sigma, independent = torque.sigma, rate / torque.rows_per_independent(rate)
        planned = information(lib, sigma, independent, payload=alone, friction=columns)
        if torque.spectrum is not None or self.cutoff is not None:
            spectrum = torque.spectrum or NoiseSpectrum(np.zeros(0), np.zeros((0, lib.n_joints)))
            if self.cutoff is not None:
                spectrum = replace(spectrum, cutoff_hz=self.cutoff)
            planned = replace(planned, spectrum=spectrum)
        if self.earlier_log:
            logs = [read_recording(log, joints=lib.joint_names) for log in self.earlier_log]
            names = FRICTION if columns is None else columns
            planned = replace(planned, earlier=information_of_logs(lib, logs, sigma, names))
        return planned, torque.sentence()

    def require_meaning(self) -> None:
        """Refuse choices that have no meaning beside others."""
        given = self.stated()
        if "poses" in given and not self.static:
            raise RuntimeFault(
                "the setting poses is the number of poses of --settings static=true; give "
                "--settings static=true too"
            )
        if self.static and (other := sorted(given.keys() - OF_POSES)):
            raise RuntimeFault(
                f"--settings static=true designs poses at rest, to which {given[other[0]]} does "
                "not apply; leave it out"
            )
        if self.motions > 1 and (other := [name for name in given if name in OF_ONE_MOTION]):
            raise RuntimeFault(
                f"the setting motions writes one file per motion, to which {given[other[0]]} does "
                "not apply; leave it out (symgen approach plans the ways of a motion and exports "
                "it)"
            )
        limits = {name for name in OF_LIMITS if name in given}
        if self.document and limits - ({"table"} if self.has_no_table else set()):
            raise RuntimeFault(
                "--settings document=true excludes --table, --box, --carry, --obstacles, --from, "
                "and the settings torque_fraction, clearance, viscous, coulomb, payload_band, "
                "friction_band and model_band; give --criterion cond instead, which keeps all "
                "limits"
            )
        if self.until is None and "gain_error" in given:
            raise RuntimeFault(
                "the setting gain_error is part of the accuracy of --until; give --until, or "
                "leave it out"
            )
        if self.until is not None and (other := [name for name in given if name in OF_TARGET]):
            raise RuntimeFault(f"--until chooses the motion by target; leave out {given[other[0]]}")
