"""Reader of result.json for commands that compute with an identified model."""

import copy
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf, isfinite, prod
from os import PathLike
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from runtime.common.files import json_of, values_of
from runtime.common.records import record_from_table
from runtime.common.tables import Table
from runtime.common.user_builds import NAME
from runtime.errors import RecordingError
from runtime.estimators.methods import METHODS
from runtime.estimators.problem import Learned
from runtime.identification.predictions_file import fitted_rows
from runtime.identification.result_record import FORMAT, OLDER, RENAMED, Part, ResultRecord
from runtime.identification.result_tables import parameter_columns, result_tables
from runtime.library import Array, Library
from runtime.library.parameters import N_PARAMETERS
from runtime.recording import Friction, Preparation, Recording
from runtime.recording.coupled_joints import independent_joints
from runtime.recording.current_gains import CurrentGains
from runtime.recording.notebook import Framed
from runtime.recording.reader import read_further
from runtime.recording.recipes.recipe import Recipe
from runtime.recording.row_marks import Marks, row_hashes, share_of_rows
from runtime.recording.unit_conversion import scaled

LARGEST_ACCEPTED = 1e100
"""Largest number that is accepted, in SI units; matplotlib cannot draw much larger ones."""
LARGEST_VALUE = 1e9
"""Bound of π and φ in SI units; larger values and NaN are refused."""
_SHAPE = re.compile(r"\((?P<sides>[\w ]+,[\w ,]*)\)(?P<empty>;| or empty)?")
"""Shape of a list in the meaning of its key."""


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

    def fitted_share(self, log: Recording) -> float:
        """Share of the rows of a log of `log_of` that the model was fitted to; 0 if unknown."""
        if self.row_marks is None:
            return 0.0
        return share_of_rows(self.row_marks, row_hashes(log, with_torque=self.gains is None))

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
        return result_tables(self.record)

    def columns_of_frame(self) -> dict[str, list[Any]]:
        """Link, parameter, value and σ [SI], one row per entry of π."""
        known, names = self.record.uncertainty, [each.name for each in self.record.links]
        if len(names) * N_PARAMETERS != len(self.pi):  # an old file may state other bodies
            names = [f"body {k + 1}" for k in range(len(self.pi) // N_PARAMETERS)]
        return parameter_columns(names, value=self.pi, sigma=known and known.pi_sigma)


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
        inner = list(enumerate(value)) if isinstance(value, tuple) else []
        if shape and isinstance(value, tuple) and (value or shape["empty"] is None):
            sides = [side.split() for side in shape["sides"].split(",") if side]
            widths = {len(row) for row in value} if len(sides) > 1 else set()
            got = (len(value), *(widths if len(widths) < 2 else {-1}))  # −1: rows differ
            expected = tuple(
                prod(int(x) if x.isdigit() else here.setdefault(x, size) for x in side)
                for side, size in zip(sides, got, strict=False)
            )
            if got != expected:
                raise ValueError(f"{place}{name} expects the shape {expected}, got {got}")
        parts = {f"{name}[{k}].": each for k, each in inner} or {f"{name}.": value}
        for index, each in parts.items():
            if isinstance(each, Part):
                _require_shapes(each, sizes, place + index)


def read_result(folder: str | PathLike[str], with_learned: bool = False) -> SavedResult:
    """Read the result that `identify` wrote.

    Args:
        folder: folder of the result, or its result.json.
        with_learned: take a result whose method learned more friction than its columns.

    Returns:
        The record, and parameters, friction and preparation of the log.

    Raises:
        RecordingError: the file is missing, damaged or of learned friction, or the argument is no
            path.
    """
    if not isinstance(folder, str | PathLike):
        raise RecordingError(f"expected the folder of a result, got {folder!r:.60}")
    folder = Path(folder)
    file = folder / "result.json" if folder.is_dir() else folder
    fitted = fitted_rows(file.parent / "predictions.npz")
    return saved_from(read_record(file), str(file), fitted, with_learned)


def saved_from(
    record: ResultRecord,
    file: str,
    fitted: tuple[Marks | None, Recipe | None],
    with_learned: bool,
) -> SavedResult:
    """A record with what commands compute with; marks and recipe of the rows of its log."""
    if not NAME.fullmatch(record.robot):
        raise RecordingError(
            f"'{file}': expected the name of a robot (a-z, 0-9, _), got "
            f"{record.robot!r:.60}; correct the file, or identify again"
        )
    terms, gains, n = record.friction, record.current_gains, len(record.joints)
    net = None if terms is None else terms.net
    if net and not with_learned:
        raise RecordingError(
            f"'{file}': expected a result whose friction is its columns, got one of the method "
            f"{record.method}, which learned more, as evaluate takes it; identify again by "
            "another method"
        )
    steps: dict[str, Any] = {
        key: tuple(x) if isinstance(x, list) else x
        for key, x in record.recording.preparation.items()
    }
    try:
        saved = SavedResult(
            record,
            pi=np.array(record.pi),
            friction=Friction.from_facts(
                {"columns": ()} if terms is None else msgspec.to_builtins(terms)
            ),
            phi=np.zeros((n, 0)) if terms is None else np.array(terms.values, dtype=float),
            preparation=Preparation(**steps),
            learned=_learned(record.method, net) if net else None,
            gains=CurrentGains.from_facts(msgspec.to_builtins(gains), "the result")
            if gains
            else None,
            row_marks=fitted[0],
            recipe=fitted[1],
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


def _learned(method: str, facts: dict[str, Any]) -> Learned:
    """Friction that a method learned."""
    read = METHODS[method].learned
    if read is None:
        raise ValueError(f"the method {method} learns no friction.net")
    return read(facts)
