"""Reader of result.json for commands that compute with an identified model.

π is written in the frames of the links, so that it holds for any library whose joints have the same
placements. Another gravity, other inertials or a newer generator leave π valid and are noted. Other
fixed links counted into the moving ones mean that π belongs to other bodies.
"""

import copy
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, prod
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import msgspec
import numpy as np

from runtime.common.files import json_of, require_file, values_of
from runtime.common.records import Vector3, record_from_table
from runtime.common.tables import Table, number
from runtime.common.user_builds import NAME
from runtime.errors import RecordingError
from runtime.estimators.methods import METHODS
from runtime.estimators.problem import Learned
from runtime.identification.result_record import (
    FORMAT,
    OLDER,
    RENAMED,
    FrictionPart,
    JointPlace,
    ModelPart,
    Part,
    ResultRecord,
)
from runtime.identification.result_tables import parameter_columns, result_tables
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS, links, mass
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.current_gains import CurrentGains
from runtime.recording.notebook import Framed
from runtime.recording.reader import read_further
from runtime.recording.recipes.recipe import Recipe
from runtime.recording.recipes.recipe_file import recipe_from_table
from runtime.recording.row_marks import Marks, row_hashes, share_of_rows
from runtime.recording.settings import COULOMB_SPEED
from runtime.recording.unit_conversion import scaled

LARGEST_ACCEPTED = 1e100
"""Largest number that is accepted, in SI units; matplotlib cannot draw much larger ones."""
LARGEST_VALUE = 1e9
"""Bound of π and φ in SI units; larger values and NaN are refused."""
ALIKE = 1e-6
"""Bound in m, m/s² or entries of rotations below which two models differ only by rounding."""
_SHAPE = re.compile(r"\((?P<sides>[\w ]+,[\w ,]*)\)(?P<empty>;| or empty)?")
"""Shape of a list in the meaning of its key."""


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
        recipe: by which the log was read; None without one.
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
    recipe: Recipe | None = None

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
        if self.record is not None:
            return result_tables(self.record)
        masses = tuple(zip(self._link_names(), map(number, mass(links(self.pi))), strict=True))
        return (Table(("link", "mass [kg]"), masses, title=f"{self.robot} by {self.method}"),)

    def columns_of_frame(self) -> dict[str, list[Any]]:
        """Link, parameter, value and σ [SI], one row per entry of π."""
        known = self.record and self.record.uncertainty
        return parameter_columns(self._link_names(), value=self.pi, sigma=known and known.pi_sigma)

    def _link_names(self) -> list[str]:
        """Names of the bodies of π, by their number where the file has none."""
        names = [] if self.record is None else [each.name for each in self.record.links]
        count = len(self.pi) // N_PARAMETERS
        return names if len(names) == count else [f"body {k + 1}" for k in range(count)]


def model_part(lib: Library) -> ModelPart:
    """The part `model` of result.json."""
    facts = lib.manifest
    return ModelPart(
        model_hash=facts.model_hash,
        gravity=msgspec.convert(lib.gravity.tolist(), Vector3),
        joints=msgspec.convert(facts.all_joints, tuple[JointPlace, ...], from_attributes=True),
        lumped=tuple(body["name"] for body in facts.lumped),
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
        names, units = record.rows_of_errors
        sizes = {"n": len(record.joints), "L": len(record.links), "r": len(names)}
        _require_shapes(record, sizes)
        if len(units) != len(names):
            raise ValueError(f"error_units expects {len(names)} texts, got {len(units)}")
        for link in record.links:
            if not all(map(isfinite, (link.mass, link.mass_before, *link.com_before))):
                raise ValueError(f"mass and com_before of {link.name} expect finite numbers")
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


def _require_shapes(part: Part, sizes: Mapping[str, int], place: str = "") -> None:
    """Refuse lists that lack the shape in the meaning of their key: (n, k), (10 L,) or empty."""
    here = dict(sizes)  # other letters are one number within a table
    for name, meaning in part.meanings().items():
        value, shape = getattr(part, name), _SHAPE.search(meaning)
        if shape and isinstance(value, tuple) and (value or shape["empty"] is None):
            sides = [side.split() for side in shape["sides"].split(",") if side]
            got = _shape(value, len(sides))
            expected = tuple(
                prod(int(x) if x.isdigit() else here.setdefault(x, size) for x in side)
                for side, size in zip(sides, got, strict=True)
            )
            if got != expected:
                raise ValueError(f"{place}{name} expects the shape {expected}, got {got}")
        inner = [(f"[{k}]", x) for k, x in enumerate(value)] if isinstance(value, tuple) else []
        for index, each in inner or [("", value)]:
            if isinstance(each, Part):
                _require_shapes(each, sizes, f"{place}{name}{index}.")


def _shape(value: Sequence[Any], dimensions: int) -> tuple[int, ...]:
    """Lengths of a list of lists; −1 where the inner ones differ."""
    if dimensions == 1:
        return (len(value),)
    widths = {len(each) for each in value}
    return (len(value), widths.pop() if len(widths) == 1 else -1)


def _fitted(file: Path) -> tuple[Marks | None, Recipe | None]:
    """Marks of the rows that were fitted, and recipe of their log, from predictions.npz."""
    try:
        with np.load(require_file(file), allow_pickle=False) as arrays:
            marks, text = (arrays.get(name, np.zeros(0)) for name in ("row_marks", "recipe"))
            table = tomllib.loads(str(text)) if text.dtype.kind == "U" else None
            recipe = None if table is None else recipe_from_table(table)
    except (OSError, ValueError, LookupError, BadZipFile, RecordingError):
        return None, None
    return marks if marks.dtype == np.uint64 and marks.ndim == 1 else None, recipe


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
    fitted = _fitted(file.parent / "predictions.npz")
    return saved_from(read_record(file), str(file), fitted, with_learned)


def saved_from(
    record: ResultRecord,
    file: str,
    fitted: tuple[Marks | None, Recipe | None],
    with_learned: bool,
) -> SavedResult:
    """Parameters, friction and preparation of a record of a file; marks and recipe of its rows."""
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
    gains = record.current_gains
    steps: dict[str, Any] = {
        key: tuple(x) if isinstance(x, list) else x
        for key, x in record.recording.preparation.items()
    }
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
            preparation=Preparation(**steps),
            model=record.model,
            record=record,
            learned=_learned(record.method, terms.net) if terms.net else None,
            gains=CurrentGains.from_facts(msgspec.to_builtins(gains), "the result")
            if gains
            else None,
            row_marks=fitted[0],
            recipe=fitted[1],
        )
        bodies = n if saved.model is None else len(saved.model.joints)
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


def _learned(method: str, facts: dict[str, Any]) -> Learned:
    """Friction that a method learned."""
    read = METHODS[method].learned
    if read is None:
        raise ValueError(f"the method {method} learns no friction.net")
    return read(facts)


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
    if len(then.joints) != len(now.joints):
        raise RecordingError(
            f"'{folder}' was identified with a model of {len(then.joints)} joints, "
            f"'{lib.name}' has {len(now.joints)}; name the library that it was identified with by "
            "--robot"
        )
    places = zip(lib.all_joint_names, then.joints, now.joints, strict=True)
    if moved := next((name for name, old, new in places if not same_place(old, new)), None):
        raise RecordingError(
            f"'{folder}' was identified with a model whose joint '{moved}' sits or turns "
            f"differently than that of '{lib.name}', so that its parameters belong to other "
            "frames; name the library that it was identified with by --robot, or identify again"
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


def same_place(a: JointPlace, b: JointPlace) -> bool:
    """Whether two joints are of one kind and differ by rounding only."""
    pairs = ((a.rotation, b.rotation), (a.translation, b.translation), (a.axis, b.axis))
    near = all(np.allclose(x, y, rtol=0, atol=ALIKE) for x, y in pairs)  # NaN counts as moved
    return near and (a.kind, a.parent) == (b.kind, b.parent)
