"""Files of a result, written and read, and whether its π holds for the model of a library.

result.json is a `ResultRecord`; predictions.npz holds torques over the test part, marks of the rows
that were fitted, and the recipe; posterior.npz is read by `posterior_file`.

π is written in the frames of the links, so that it holds for any library whose joints have the same
placements. Another gravity, other inertials or a newer generator leave π valid and are noted. Other
fixed links counted into the moving ones mean that π belongs to other bodies.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf, isfinite, prod
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import msgspec
import numpy as np

from runtime.common.files import folder_of, json_of, replacing, require_file, values_of, write_json
from runtime.common.records import Vector3, record_from_table
from runtime.common.tables import Table
from runtime.common.user_builds import NAME
from runtime.errors import RecordingError
from runtime.estimators.methods import METHODS
from runtime.estimators.problem import Learned
from runtime.identification.result_record import (
    FORMAT,
    RENAMED,
    JointPlace,
    ModelPart,
    Part,
    ResultRecord,
)
from runtime.identification.result_tables import error_table, link_table, parameter_columns
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.current_gains import CurrentGains
from runtime.recording.formats.npz import open_npz
from runtime.recording.notebook import Framed
from runtime.recording.reader import read_further
from runtime.recording.recipes.recipe import Recipe
from runtime.recording.recipes.recipe_file import recipe_from_table
from runtime.recording.row_marks import Marks, row_hashes, share_of_rows
from runtime.recording.unit_conversion import scaled

FRAMES, BODIES, PRIOR = "frames", "bodies", "prior"
"""Kinds of differences: π of one model means nothing, other bodies, or the same in the other."""
ALIKE = 1e-6  # bound in m, m/s² or entries of rotations below which models differ only by rounding


def model_part(lib: Library) -> ModelPart:
    """The part `model` of result.json."""
    facts = lib.manifest
    return ModelPart(
        model_hash=facts.model_hash,
        gravity=msgspec.convert(lib.gravity.tolist(), Vector3),
        joints=msgspec.convert(facts.all_joints, tuple[JointPlace, ...], from_attributes=True),
        lumped=tuple(body["name"] for body in facts.lumped),
    )


def require_model(
    record: ResultRecord, lib: Library, folder: Path | str, same_bodies: bool = False
) -> tuple[str, ...]:
    """Check that a result holds for the model of a library."""
    if record.joints != lib.joint_names:
        raise RecordingError(
            f"'{folder}' identified {record.robot}, whose joints differ from those of "
            f"'{lib.name}'; name its robot with --robot"
        )
    if record.model is None:
        return ()
    joints = [f"'{name}'" for name in lib.all_joint_names]
    notes = differences(record.model, model_part(lib), (str(folder), lib.name), joints)
    refused = {FRAMES, BODIES} if same_bodies else {FRAMES}
    if fault := next((sentence for kind, sentence in notes if kind in refused), None):
        raise RecordingError(
            f"{fault}; name the library that it was identified with by --robot, or identify again"
        )
    return tuple(sentence for _, sentence in notes)


def differences(
    one: ModelPart, two: ModelPart, names: tuple[str, str], joints: Iterable[str]
) -> list[tuple[str, str]]:
    """Kind of every difference of two models, and a sentence; other frames hide what follows."""
    if one.model_hash == two.model_hash:
        return []
    first, second = f"'{names[0]}' was identified with", f"'{names[1]}'"
    count, other = len(one.joints), len(two.joints)
    if count != other:
        return [(FRAMES, f"{first} a model of {count} joints, {second} has {other}")]
    places = zip(joints, one.joints, two.joints, strict=True)
    if moved := next((name for name, a, b in places if not same_place(a, b)), None):
        sentence = (
            f"{first} a model whose joint {moved} sits or turns differently than that of {second}, "
            "so that its parameters belong to other frames"
        )
        return [(FRAMES, sentence)]
    notes = []
    if others := ", ".join(sorted(set(one.lumped) ^ set(two.lumped))):
        sentence = (
            f"{first} other fixed links counted into moving ones than {second} has ({others}): "
            "its masses belong to other bodies"
        )
        notes.append((BODIES, sentence))
    if not np.abs(np.subtract(one.gravity, two.gravity)).max() <= ALIKE:
        old, new = (",".join(f"{x:g}" for x in each.gravity) for each in (one, two))
        sentence = f"{first} gravity {old}, and {second} has {new}: right if the arm was mounted"
        notes.append((PRIOR, f"{sentence} again in between"))
    build = (
        f"{first} another build of this arm (model {one.model_hash[:12]}, {second} has "
        f"{two.model_hash[:12]}): the joints are the same, inertials, limits or the generator are "
        "not"
    )
    return notes or [(PRIOR, build)]


def same_place(a: JointPlace, b: JointPlace) -> bool:
    """Whether two joints are of one kind and differ by rounding only."""
    pairs = ((a.rotation, b.rotation), (a.translation, b.translation), (a.axis, b.axis))
    near = all(np.allclose(x, y, rtol=0, atol=ALIKE) for x, y in pairs)  # NaN counts as moved
    return near and (a.kind, a.parent) == (b.kind, b.parent)


LARGEST_ACCEPTED = 1e100
"""Size from which on a number is damage [SI]: its square times that of another overflows, and
matplotlib cannot draw much larger ones."""
LARGEST_VALUE = 1e9  # bound of π and φ in SI units; larger values and NaN are refused
_SHAPE = re.compile(r"\((?P<sides>[\w ]+,[\w ,]*)\)(?P<empty>;| or empty)?")
"""Shape of a list in the meaning of its key."""
_REST = re.compile(r"^: |; (correct it|add it|write it flat)$")


@dataclass(frozen=True, slots=True, eq=False)
class SavedResult(Framed):
    """Record of a result, with the arrays and settings that commands compute with.

    Attributes:
        record: content of result.json.
        pi: standard parameters, (10 n,).
        friction: friction model with k columns.
        phi: friction coefficients, (n, k).
        preparation: settings of the preparation of its log.
        learned: friction beyond φ, where the method learned one.
        gains: of the motor currents of its log; None where the log held torques.
        row_marks: of the rows that were fitted; None where the folder holds none.
        recipe: by which the log was read; None without one.
    """

    record: ResultRecord
    pi: Array
    friction: Friction
    phi: Array
    preparation: Preparation
    learned: Learned | None = None
    gains: CurrentGains | None = None
    row_marks: Marks | None = None
    recipe: Recipe | None = None

    @property
    def usual_phi(self) -> Array:
        """φ of the columns of `friction`, (n, k)."""
        return self.phi

    def fitted_share(self, log: Recording) -> float:
        """Share of the rows of a log of `log_of` that the model was fitted to; 0 if unknown."""
        marks, torque = self.row_marks, self.gains is None
        return 0.0 if marks is None else share_of_rows(marks, row_hashes(log, with_torque=torque))

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
            recipe: name or file of a recipe; None finds it beside the log or in the result.
            run: run of a data set that holds several.

        Returns:
            The recording, torques in N·m or N.
        """
        if not isinstance(log, Recording):
            place = log if isinstance(log, str) else Path(log)
            log = read_further(place, recipe, run, lib.joint_names, self.recipe)
        recording = independent_joints(log, lib)
        return recording if self.gains is None else scaled(recording, self.gains)

    def tables(self) -> tuple[Table, ...]:
        """Torque errors and bodies of the links."""
        record, errors = self.record, (self.record.torque_error_percent, self.record.torque_rms)
        title = f"{record.robot} by {record.method}: {record.status}"
        return error_table(*record.rows_of_errors, *errors, title), link_table(record.links)

    def columns_of_frame(self) -> dict[str, list[Any]]:
        """Link, parameter, value and σ [SI], one row per entry of π."""
        known, names = self.record.uncertainty, [each.name for each in self.record.links]
        if len(names) * N_PARAMETERS != len(self.pi):  # an old file may state other bodies
            names = [f"body {k + 1}" for k in range(len(self.pi) // N_PARAMETERS)]
        return parameter_columns(names, value=self.pi, sigma=known and known.pi_sigma)


POSTERIOR, PREDICTIONS = "posterior.npz", "predictions.npz"  # beside result.json


@dataclass(frozen=True, slots=True, eq=False)
class ResultFiles:
    """Content of the files of a result."""

    record: ResultRecord  # of result.json
    predictions: dict[str, Any]  # torques over the test part, row marks and recipe
    posterior: dict[str, Any] | None  # fields of its posterior; None without one

    def write(self, folder: Path) -> None:
        """Write every file, each as a whole or not at all."""
        if self.posterior is not None:
            with replacing(folder / POSTERIOR) as content:
                np.savez_compressed(content, **self.posterior)
        with replacing(folder / PREDICTIONS) as content:
            np.savez(content, **self.predictions)  # noise does not compress
        write_json(folder / "result.json", msgspec.to_builtins(self.record))


def read_record(path: Path) -> ResultRecord:
    """Read a result.json of any format; lists have the lengths that belong together."""
    try:
        facts = json_of(path)
        if not isinstance(facts, dict):
            raise ValueError(f"expected a table, got {facts!r:.40}")
        facts = migrated(facts, path)
        if any(isinstance(x, float) and LARGEST_ACCEPTED < abs(x) < inf for x in values_of(facts)):
            raise ValueError(f"a number above {LARGEST_ACCEPTED:g}")
        record = record_from_table(ResultRecord, facts, "", ValueError, allows_infinite=True)
        names, units = record.rows_of_errors
        _require_shapes(record, {"n": len(record.joints), "L": len(record.links), "r": len(names)})
        if len(units) != len(names):
            raise ValueError(f"error_units expects {len(names)} texts, got {len(units)}")
        for link in record.links:
            if not all(map(isfinite, (link.mass, link.mass_before, *link.com_before))):
                raise ValueError(f"mass and com_before of {link.name} expect finite numbers")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or re.sub(_REST, "", str(error)).strip()
        fault = f"cannot read '{path}'" if isinstance(error, OSError) else f"'{path}' is damaged"
        raise RecordingError(
            f"{fault} ({reason}), so that it holds no valid result.json; identify again, "
            "or give the folder that identify wrote"
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
        try:
            writer = f" (written by symgen {facts['provenance']['versions']['symgen']!s:.20})"
        except (KeyError, TypeError):
            writer = ""
        raise RecordingError(
            f"'{path}' has the format {number}{writer}, expected {FORMAT} or less; update symgen, "
            "or identify again with this version"
        )
    if number == FORMAT:
        return facts
    now = _renewed(facts, ResultRecord) | {"format": FORMAT}
    if isinstance(now.get("joints"), list) and not now.get("units"):
        now["units"] = [""] * len(now["joints"])
    return now


def _renewed(value: Any, kind: type[Part]) -> Any:
    """A table or list of tables of formats 1 and 2 with names and keys of the present one."""
    if isinstance(value, list):
        return [_renewed(each, kind) for each in value]
    if not isinstance(value, dict):
        return value
    now = {RENAMED.get(key, key): each for key, each in value.items()}
    for key, (_, older, table) in kind.keys().items():
        if older and now.get(key) is None:
            now[key] = older[0]
        if table is not None and key in now:
            now[key] = _renewed(now[key], table)
    return now


def _require_shapes(part: Part, sizes: Mapping[str, int], place: str = "") -> None:
    """Refuse lists that lack the shape in the meaning of their key: (n, k), (10 L,) or empty."""
    here = dict(sizes)  # other letters are one number within a table
    for name, (meaning, *_) in part.keys().items():
        value, shape = getattr(part, name), _SHAPE.search(meaning)
        many = value if isinstance(value, tuple) else None
        if shape and many is not None and (many or shape["empty"] is None):
            sides = [side.split() for side in shape["sides"].split(",") if side]
            got = (*np.array(many, dtype=object).shape, -1)[: len(sides)]  # −1: rows differ
            expected = tuple(
                prod(int(x) if x.isdigit() else here.setdefault(x, size) for x in side)
                for side, size in zip(sides, got, strict=False)
            )
            if got != expected:
                raise ValueError(f"{place}{name} expects the shape {expected}, got {got}")
        for k, each in enumerate((value,) if many is None else many):
            if isinstance(each, Part):
                index = "" if many is None else f"[{k}]"
                _require_shapes(each, sizes, f"{place}{name}{index}.")


def read_predictions(result: Path, **shapes: tuple[int, ...]) -> dict[str, Array]:
    """Instants t (N,) and named arrays (N, …) of finite numbers from the file of a result."""
    path = folder_of(result) / PREDICTIONS
    expected = ", ".join(f"{name} {_text(shape)}" for name, shape in shapes.items())
    fault = (
        "identify again, or give the output folder of an identification; expected t (N,), "
        f"{expected}"
    )
    try:
        file = open_npz(require_file(path).read_bytes(), path.name)
        arrays = {name: np.asarray(file[name], dtype=float) for name in ("t", *shapes)}
    except OSError as error:
        reason = error.strerror or error
        raise RecordingError(f"cannot read '{path}' ({reason}); {fault}") from None
    except (RecordingError, ValueError, KeyError, TypeError):
        raise RecordingError(f"'{path}' is damaged; {fault}") from None
    t = arrays["t"]
    if t.ndim != 1 or len(t) < 2 or any(arrays[n].shape != (len(t), *shapes[n]) for n in shapes):
        came = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise RecordingError(f"'{path}' holds {came}; {fault}")
    if not all(np.abs(x).max(initial=0.0) <= LARGEST_ACCEPTED for x in arrays.values()):  # nor NaN
        raise RecordingError(f"'{path}' holds NaN or numbers above {LARGEST_ACCEPTED:g}; {fault}")
    return arrays


def fitted_rows(result: Path) -> tuple[Marks | None, Recipe | None]:
    """Marks of the rows that were fitted, and recipe of their log, where the file holds them."""
    try:
        with np.load(require_file(folder_of(result) / PREDICTIONS), allow_pickle=False) as arrays:
            marks, text = (arrays.get(name, np.zeros(0)) for name in ("row_marks", "recipe"))
            table = tomllib.loads(str(text)) if text.dtype.kind == "U" else None
            recipe = None if table is None else recipe_from_table(table)
    except (OSError, ValueError, LookupError, BadZipFile, RecordingError):
        return None, None
    return marks if marks.dtype == np.uint64 and marks.ndim == 1 else None, recipe


def _text(shape: tuple[int, ...]) -> str:
    return f"({', '.join(map(str, ('N', *shape)))})"


def read_result(folder: str | PathLike[str], with_learned: bool = False) -> SavedResult:
    """Read the result that `identify` wrote.

    Args:
        folder: folder of the result, or its result.json.
        with_learned: take a result whose method learned more friction than its columns.

    Returns:
        The record, and parameters, friction and preparation of the log.

    Raises:
        RecordingError: no path is given, or the file is missing, damaged or of learned friction.
    """
    if not isinstance(folder, str | PathLike):
        raise RecordingError(f"expected the folder of a result, got {folder!r:.60}")
    folder = Path(folder)
    file = folder / "result.json" if folder.is_dir() else folder
    return saved_from(read_record(file), str(file), with_learned, *fitted_rows(file))


def saved_from(record: ResultRecord, file: str, with_learned: bool, *fitted: Any) -> SavedResult:
    """A record with what commands compute with; marks and recipe of the rows of its log."""
    if not NAME.fullmatch(record.robot):
        raise RecordingError(
            f"'{file}': expected the name of a robot (a-z, 0-9, _), got "
            f"{record.robot!r:.60}; correct the file, or identify again"
        )
    terms, gains, n = record.friction, record.current_gains, len(record.joints)
    net = terms and terms.net
    if net and not with_learned:
        raise RecordingError(
            f"'{file}': expected a result whose friction is its columns, got one whose method "
            f"{record.method} learned more, as evaluate takes it; identify again by another method"
        )
    try:
        read = METHODS[record.method].learned if net else None
        if net and read is None:
            raise ValueError(f"the method {record.method} learns no friction.net")
        saved = SavedResult(
            record,
            np.array(record.pi),
            Friction.from_facts(msgspec.to_builtins(terms) if terms else {"columns": ()}),
            np.array(terms.values, dtype=float) if terms else np.zeros((n, 0)),
            msgspec.convert(record.recording.preparation, Preparation),
            read(net) if net and read else None,
            CurrentGains.from_facts(msgspec.to_builtins(gains), "the result") if gains else None,
            *fitted,
        )
        bodies = n if record.model is None else len(record.model.joints)
        if saved.pi.shape != (N_PARAMETERS * bodies,):
            raise ValueError(f"pi expects {N_PARAMETERS * bodies} numbers, got {saved.pi.size}")
        values = (*saved.pi, *saved.phi.ravel(), *(each.gain for each in gains or ()))
        if not all(abs(value) < LARGEST_VALUE for value in values):
            raise ValueError(
                f"pi, friction.values and current_gains expect numbers below {LARGEST_VALUE:g}"
            )
        if saved.learned and saved.learned(np.zeros((1, *saved.phi.shape))).shape != (1, n):
            raise ValueError("friction.net does not fit to the joints")
    except (RecordingError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise RecordingError(
            f"'{file}' holds no valid result.json ({error}); give the folder that identify wrote"
        ) from None
    return saved
