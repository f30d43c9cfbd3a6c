"""Reader of result.json for commands that compute with an identified model.

π is written in the frames of the links, so that it holds for any library whose joints have the same
placements. Another gravity, other inertials or a newer generator leave π valid and are noted. Other
fixed links counted into the moving ones mean that π belongs to other bodies.
"""

import copy
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from math import inf, isfinite
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import msgspec
import numpy as np

from runtime.common.files import json_of, require_file, values_of
from runtime.common.records import record_from_table
from runtime.common.user_builds import NAME
from runtime.errors import RecordingError
from runtime.estimators.methods import METHODS
from runtime.estimators.problem import Learned
from runtime.identification.result_record import (
    FORMAT,
    OLDER,
    RENAMED,
    CurrentGain,
    FrictionPart,
    JointPlace,
    ModelPart,
    ResultRecord,
)
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, PI_NAMES, first_moment, links, mass
from runtime.recording import Friction, Preparation, Recording, read_recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.current_gains import CurrentGains
from runtime.recording.notebook import Framed, html_table
from runtime.recording.row_marks import Marks, row_hashes, share_of_rows
from runtime.recording.settings import COULOMB_SPEED
from runtime.recording.unit_conversion import scaled

LARGEST_ACCEPTED = 1e100
"""Largest number that is accepted, in SI units; matplotlib cannot draw much larger ones."""
LARGEST_VALUE = 1e9
"""Bound of π and φ in SI units; larger values and NaN are refused."""
ALIKE = 1e-6
"""Bound in m, m/s² or entries of rotations below which two models differ only by rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class SavedResult(Framed):
    """Parameters and friction of a result.json, with the preparation of its log.

    Attributes:
        robot: name of the robot.
        method: name of the method.
        joints: names of the joints.
        units: units of their torques.
        pi: standard parameters, (10 n,).
        friction: friction model with k columns.
        phi: friction coefficients, (n, k).
        history: sentences on the preparation of the log.
        preparation: settings of the preparation.
        model: model of the parameters; None in files that lack it.
        record: the whole content of the file; None of a model that is of no file.
        learned: friction beyond φ, where the method learned one.
        gains: of the motor currents of its log; None where the log held torques.
        row_marks: of the rows that were fitted; None where the folder holds none.
    """

    robot: str
    method: str
    joints: tuple[str, ...]
    units: tuple[str, ...]
    pi: Array
    friction: Friction
    phi: Array
    history: tuple[str, ...]
    preparation: Preparation
    model: ModelPart | None
    record: ResultRecord | None = None
    learned: Learned | None = None
    gains: CurrentGains | None = None
    row_marks: Marks | None = None

    def fitted_share(self, log: Recording) -> float:
        """Share of the rows of a log of `log_of` that the model was fitted to; 0 if unknown."""
        if self.row_marks is None:
            return 0.0
        return share_of_rows(self.row_marks, row_hashes(log, with_torque=self.gains is None))

    @property
    def is_free(self) -> bool:
        """Whether the base of the robot is free, as that of one that walks."""
        return self.record is not None and self.record.base == "free"

    def log_of(
        self,
        log: Recording | str | PathLike[str],
        lib: Library,
        recipe: str | None = None,
        run: str | None = None,
    ) -> Recording:
        """Another log of the robot, motor currents as torques by the gains of the result.

        Args:
            log: file, folder or name of a bundled log, or a log as it was read.
            lib: library of the robot.
            recipe: name or file of a recipe; None finds it.
            run: run of a data set that holds several.

        Returns:
            The recording, torques in N·m or N.
        """
        if not isinstance(log, Recording):
            log = read_recording(
                log if isinstance(log, str) else Path(log), recipe, run, lib.joint_names
            )
        recording = independent_joints(log, lib)
        return recording if self.gains is None else scaled(recording, self.gains)

    def _repr_html_(self) -> str:
        """Torque errors and bodies of the links, as tables for notebooks."""
        known = self.record
        torque = [
            (name, _number(old, ".2f"), _number(new, ".2f"), f"{_number(size, '.4f')} {unit}")
            for name, unit, old, new, size in (
                zip(
                    *(self.joints, self.units),
                    known.torque_error_percent.before,
                    known.torque_error_percent.after,
                    known.torque_rms.after,
                    strict=True,
                )
                if known is not None
                else ()
            )
        ]
        bodies = [
            (name, f"{m:.4f}", ", ".join(f"{x:.4f}" for x in h / m) if m else "–")
            for name, m, h in zip(
                self._link_names(), mass(links(self.pi)), first_moment(links(self.pi)), strict=True
            )
        ]
        status = "no result.json" if known is None else known.status
        title = f"{self.robot} by {self.method}: {status}"
        head = ("joint", "error of URDF [%]", "error [%]", "RMS error")
        errors = html_table(title, torque, head)
        return errors + html_table("links", bodies, ("link", "mass [kg]", "centre of mass [m]"))

    def columns_of_frame(self) -> dict[str, list[Any]]:
        """Link, parameter, value and σ [SI], one row per entry of π."""
        rows = [(link, name) for link in self._link_names() for name in PI_NAMES]
        columns: dict[str, list[Any]] = {
            "link": [link for link, _ in rows],
            "parameter": [name for _, name in rows],
            "value": self.pi.tolist(),
        }
        known = None if self.record is None else self.record.uncertainty
        if known is not None:
            columns["sigma"] = list(known.pi_sigma)
        return columns

    def _link_names(self) -> list[str]:
        """Names of the bodies of π, by their number where the file has none."""
        names = [] if self.record is None else [each.name for each in self.record.links]
        count = len(self.pi) // N_PARAMETERS
        return names if len(names) == count else [f"body {k + 1}" for k in range(count)]


def _number(value: float | None, form: str) -> str:
    """A number of the file; a dash where it has none."""
    return "–" if value is None else format(value, form)


def model_part(lib: Library) -> ModelPart:
    """The part `model` of result.json."""
    return ModelPart(
        model_hash=lib.manifest.model_hash,
        gravity=tuple(lib.gravity.tolist()),
        joints=tuple(
            JointPlace(
                kind=joint.kind,
                parent=joint.parent,
                rotation=joint.rotation,
                translation=tuple(np.array(joint.translation).tolist()),
                axis=tuple(np.array(joint.axis).tolist()),
            )
            for joint in lib.manifest.all_joints
        ),
        lumped=tuple(body["name"] for body in lib.manifest.lumped),
    )


def read_record(path: Path) -> ResultRecord:
    """Read a result.json of any format; lists have the lengths that belong together."""
    again = "identify again, or give the folder that identify wrote"
    try:
        facts = json_of(path)
        if not isinstance(facts, dict):
            raise ValueError(f"expected a table, got {facts!r:.40}")
        facts = migrated(facts, path)
        if any(isinstance(x, float) and LARGEST_ACCEPTED < abs(x) < inf for x in values_of(facts)):
            raise ValueError(f"a number above {LARGEST_ACCEPTED:g}")
        record = record_from_table(ResultRecord, facts, "", ValueError, allows_infinite=True)
        _require_shapes(record)
    except OSError as error:
        raise RecordingError(
            f"cannot read '{path}' ({error.strerror or error}), so that it holds no valid "
            f"result.json; {again}"
        ) from None
    except ValueError as error:
        reason = re.sub(r"^: |; (correct it|add it|write it flat)$", "", str(error)).strip()
        raise RecordingError(
            f"'{path}' is damaged and holds no valid result.json ({reason}); {again}"
        ) from None
    return record


def migrated(facts: dict[str, Any], path: Path | str = "result.json") -> dict[str, Any]:
    """Facts of any format as facts of the present one; unchanged where they are of it."""
    number = facts.get("format", 1)
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise ValueError(f"format expects a whole number above 0, got {number!r:.40}")
    if "free_base" in facts:
        raise RecordingError(
            f"'{path}' is the result of a robot with a free base of format 2 or earlier, expected "
            f"format {FORMAT}, which states its model; identify again with this version"
        )
    if number > FORMAT:
        versions = next((t for t, _ in _places(facts, "provenance.versions.symgen")), {})
        writer = f" (written by symgen {versions['symgen']})" if "symgen" in versions else ""
        raise RecordingError(
            f"'{path}' has the format {number}{writer}, expected {FORMAT} or less; update symgen, "
            "or identify again with this version"
        )
    if number == FORMAT:
        return facts
    now = copy.deepcopy(facts)
    for key, name in RENAMED.items():
        for table, old in _places(now, key):
            if old in table:
                table[name] = table.pop(old)
    if isinstance(now.get("joints"), list) and not now.get("units"):
        now["units"] = [""] * len(now["joints"])
    for key, value in OLDER.items():
        for table, name in _places(now, key):
            if table.get(name) is None:
                table[name] = copy.deepcopy(value)
    now["format"] = FORMAT
    return now


def _places(facts: dict[str, Any], key: str) -> Iterator[tuple[dict[str, Any], str]]:
    """Tables that have or could have a key, each with its last name."""
    *parents, name = key.split(".")
    tables: list[Any] = [facts]
    for parent in parents:
        values = [each.get(parent.removesuffix("[]")) for each in tables if isinstance(each, dict)]
        if parent.endswith("[]"):
            values = [each for value in values if isinstance(value, list) for each in value]
        tables = values
    yield from ((table, name) for table in tables if isinstance(table, dict))


def _require_shapes(record: ResultRecord) -> None:
    """Refuse lists whose lengths do not belong together, and bodies that are no numbers."""
    for name, value, shape in _shapes(record):
        if isinstance(value, tuple) and _shape(value, len(shape)) != shape:
            got = _shape(value, len(shape))
            raise ValueError(f"{name} expects the shape {shape}, got {got}")
    for link in record.links:
        if not all(map(isfinite, (link.mass, link.mass_before, *link.com_before))):
            raise ValueError(f"mass and com_before of {link.name} expect finite numbers")


def _shapes(record: ResultRecord) -> Iterator[tuple[str, Any, tuple[int, ...]]]:
    """Name, value and expected shape of the lists; a value that is no list is not of interest."""
    n, bodies = len(record.joints), len(record.links)
    for name in ("units", "drive", "current_gains", "delay_s", "control_law.kp", "control_law.kd"):
        yield name, reduce(_field, name.split("."), record), (n,)
    for name in ("noise", "model_band", "white_lag_share"):  # empty for a free base
        value = getattr(record.uncertainty, name, None)
        yield f"uncertainty.{name}", value if value or record.base == "fixed" else None, (n,)
    rows = len(record.rows_of_errors[0])
    yield "error_units", record.rows_of_errors[1], (rows,)
    for name in ("torque_error_percent", "torque_rms"):
        for when in ("before", "after"):
            yield f"{name}.{when}", getattr(getattr(record, name), when), (rows,)
    for k, joint in enumerate(() if record.model is None else record.model.joints):
        yield f"model.joints[{k}].rotation", joint.rotation, (3, 3)
    if (friction := record.friction) is not None:
        yield "friction.values", friction.values, (n, len(friction.columns))
    if (known := record.uncertainty) is not None:
        yield "uncertainty.detectable_gain_error", known.detectable_gain_error or None, (n,)
        yield "uncertainty.links", known.links, (bodies,)
        for k, link in enumerate(known.links):
            yield f"uncertainty.links[{k}].verdicts", link.verdicts, (N_PARAMETERS,)
    if (run := record.convergence) is not None:
        yield "convergence.training", run.training, (len(run.iteration),)
        yield "convergence.validation", run.validation, (len(run.iteration),)
    for k, pair in enumerate(record.symmetric or ()):
        yield f"symmetric[{k}].sigma", pair.sigma, _shape(pair.values, 2)
    if (logs := record.sessions) is not None:
        count = len(logs.leave_one_out)
        yield "sessions.payload_kg", logs.payload_kg, (count,)
        yield "sessions.repeatability.masses", logs.repeatability.masses, (count, bodies)
        yield "sessions.repeatability.mass_spread", logs.repeatability.mass_spread, (bodies,)


def _field(table: Any, name: str) -> Any:
    return getattr(table, name, None)


def _shape(value: Sequence[Any], dimensions: int) -> tuple[int, ...]:
    """Lengths of a list of lists; −1 where the inner ones differ."""
    if dimensions == 1:
        return (len(value),)
    widths = {len(each) for each in value}
    return (len(value), widths.pop() if len(widths) == 1 else -1)


def _row_marks(file: Path) -> Marks | None:
    """Marks of the rows that were fitted, from predictions.npz."""
    try:
        with np.load(require_file(file), allow_pickle=False) as arrays:
            marks = arrays["row_marks"]
    except (OSError, ValueError, LookupError, BadZipFile):
        return None
    return marks if marks.dtype == np.uint64 and marks.ndim == 1 else None


def read_result(folder: str | PathLike[str], with_learned: bool = False) -> SavedResult:
    """Read the result that `identify` wrote.

    Args:
        folder: folder of the result, or its result.json.
        with_learned: take a result whose method learned more friction than its columns.

    Returns:
        Parameters, friction, preparation of the log, and the whole record.

    Raises:
        RecordingError: the file is missing, damaged or of learned friction, or the argument is no
            path.
    """
    if not isinstance(folder, str | PathLike):
        raise RecordingError(f"expected the folder of a result, got {folder!r:.60}")
    folder = Path(folder)
    file = folder / "result.json" if folder.is_dir() else folder
    marks = _row_marks(file.parent / "predictions.npz")
    return saved_from(read_record(file), str(file), marks, with_learned)


def saved_from(
    record: ResultRecord, file: str, marks: Marks | None, with_learned: bool
) -> SavedResult:
    """Parameters, friction and preparation of a record of a file."""
    if not NAME.fullmatch(record.robot):
        raise RecordingError(
            f"'{file}': expected the name of a robot (a-z, 0-9, _), got "
            f"{record.robot!r:.60}; correct the file, or identify again"
        )
    n = len(record.joints)
    terms = record.friction or FrictionPart(
        columns=(), values=((),) * n, coulomb_speed=COULOMB_SPEED
    )
    if terms.net and not with_learned:
        raise RecordingError(
            f"'{file}': expected a result whose friction is its columns, got one of the method "
            f"{record.method}, which learned more, as evaluate takes it; identify again by "
            "another method"
        )
    try:
        saved = SavedResult(
            robot=record.robot,
            method=record.method,
            joints=record.joints,
            units=record.units,
            pi=np.array(record.pi),
            friction=Friction.from_facts(msgspec.to_builtins(terms)),
            phi=np.array(terms.values, dtype=float),
            history=record.recording.history,
            preparation=_preparation(record.recording.preparation),
            model=record.model,
            record=record,
            learned=_learned(record.method, terms.net),
            gains=_gains(record.current_gains),
            row_marks=marks,
        )
        bodies = n if saved.model is None else len(saved.model.joints)
        if saved.pi.shape != (N_PARAMETERS * bodies,):
            raise ValueError(f"pi expects {N_PARAMETERS * bodies} numbers, got {saved.pi.size}")
        if not (np.abs(np.concatenate([saved.pi, saved.phi.ravel()])) < LARGEST_VALUE).all():
            raise ValueError(f"pi and friction.values expect numbers below {LARGEST_VALUE:g}")
        if saved.learned and saved.learned(np.zeros((1, *saved.phi.shape))).shape != (1, n):
            raise ValueError("friction.net does not fit to the joints")
    except (RecordingError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise RecordingError(
            f"'{file}' holds no valid result.json ({error}); give the folder that identify wrote"
        ) from None
    return saved


def _learned(method: str, facts: Any) -> Learned | None:
    """Friction that a method learned; None where the file has none."""
    if not facts:
        return None
    read = METHODS[method].learned
    if read is None:
        raise ValueError(f"the method {method} learns no friction.net")
    return read(facts)


def _gains(gains: tuple[CurrentGain, ...] | None) -> CurrentGains | None:
    """Gains of motor currents; None where the log held torques."""
    if not gains:
        return None
    read = CurrentGains.from_facts([msgspec.to_builtins(each) for each in gains], "the result")
    if not (np.abs(read.gain) < LARGEST_VALUE).all():
        raise ValueError(f"current_gains expect numbers below {LARGEST_VALUE:g}")
    return read


def _preparation(facts: dict[str, Any]) -> Preparation:
    """Preparation; delays per joint are a list in the file."""
    lists: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in facts.items()}
    return Preparation(**lists)


def _frames(model: ModelPart) -> Array:
    """Rotation, translation [m] and axis of every joint, (n, 15)."""
    rows = [np.hstack([np.ravel(x) for x in (j.rotation, j.translation, j.axis)])
            for j in model.joints]  # fmt: skip
    return np.array(rows, dtype=float).reshape(len(rows), 15)


def require_model(
    saved: SavedResult, lib: Library, folder: Path | str, same_bodies: bool = False
) -> tuple[str, ...]:
    """Check that a result holds for the model of a library."""
    if saved.joints != lib.joint_names:
        raise RecordingError(
            f"'{folder}' identified {saved.robot}, whose joints differ from those of "
            f"'{lib.name}'; name its robot with --robot"
        )
    then, now = saved.model, model_part(lib)
    if then is None or then.model_hash == now.model_hash:
        return ()
    kinds = [[(joint.kind, joint.parent) for joint in each.joints] for each in (then, now)]
    moved = ~(np.abs(_frames(then) - _frames(now)).max(axis=1) <= ALIKE)  # NaN counts as moved
    moved |= np.array([a != b for a, b in zip(*kinds, strict=True)])
    if moved.any():
        raise RecordingError(
            f"'{folder}' was identified with a model whose joint "
            f"'{lib.all_joint_names[int(np.argmax(moved))]}' sits or turns differently "
            f"than that of '{lib.name}', so that its parameters belong to other frames; name the "
            "library that it was identified with by --robot, or identify again"
        )
    if others := set(then.lumped) ^ set(now.lumped):
        other = ", ".join(sorted(others))
        difference = (
            f"'{folder}' was identified with other fixed links counted into moving ones than "
            f"'{lib.name}' has ({other})"
        )
        if same_bodies:
            raise RecordingError(
                f"{difference}; name the library that it was identified with by --robot"
            )
        return (f"{difference}: its masses belong to other bodies",)
    if not np.abs(np.subtract(then.gravity, now.gravity)).max() <= ALIKE:
        old, new = (",".join(f"{x:g}" for x in g) for g in (then.gravity, now.gravity))
        return (
            f"'{folder}' was identified with gravity {old}, and '{lib.name}' has {new}: right "
            "if the arm was mounted again in between",
        )
    return (
        f"'{folder}' was identified with another build of this arm (model {then.model_hash[:12]}, "
        f"here {now.model_hash[:12]}): the joints are the same, inertials, limits or the generator "
        "are not",
    )
