"""Settings of `symgen excite`."""

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from runtime.campaign.shortest_session import target_of
from runtime.cli import planned_log
from runtime.cli.common import numbers_option, sentences_of
from runtime.cli.motion_limits import LimitChoices
from runtime.cli.motion_output import EXPORT_MARGIN, MotionChoices
from runtime.common.settings import data_field, method_field, model_field, output_field
from runtime.common.terminal import completing
from runtime.common.threads import cores
from runtime.errors import IdentificationError, RuntimeFault
from runtime.excitation.limits.safety import Safety
from runtime.excitation.motion.trajectory import BASES, basis_of
from runtime.excitation.search.criteria import CRITERIA, criterion_of
from runtime.excitation.search.design_settings import DesignSettings
from runtime.excitation.search.information import FRICTION, Information, NoiseSpectrum, information
from runtime.identification.expected_accuracy.planned_samples import information_of_logs
from runtime.library import Library
from runtime.recording import read_recording
from runtime.recording.settings import COLUMNS

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
    noise: str = model_field("0.05", metavar="σ|LOG", help=f"{planned_log.NOISE_HELP}.")
    noise_model: planned_log.NoiseModel = planned_log.WHITE
    cutoff: planned_log.Cutoff = None
    log_rate: float = data_field(100.0, help="Rate at which the robot will record the motion, Hz.")
    friction: str | None = model_field(
        metavar="COLUMNS",
        autocompletion=completing(COLUMNS),
        help="Friction columns that are estimated too, with commas, or none; default "
        f"{','.join(FRICTION)}, with --settings payload_only=true offset. All criteria but the "
        "document's cond count them.",
    )
    earlier_log: planned_log.EarlierLogs = None
    payload_only: planned_log.PayloadOnly = False
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
        planned, note = self.planned(lib, alone)
        is_informed = criterion_of(wanted).needs_information or bool(self.earlier_log) or alone
        if planned.spectrum is not None and not is_informed:
            raise IdentificationError(
                f"criterion {wanted} counts neither noise nor filter; leave out the settings "
                "cutoff and noise_model, or give another --criterion such as v"
            )
        home = None
        if self.home is not None:
            home = np.array(numbers_option(self.home, lib.n_joints, "the setting home"))
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
        columns = None if self.friction is None else planned_log.friction_columns(self.friction)
        torque = planned_log.planned_noise(lib, self.noise, columns, self.noise_model)
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
