"""Files → `Recording`: units, signs, joint order and gear are applied here and nowhere else.

Corrupt rows are dropped, counted and noted in the history; data that are not a recording raise one
sentence of `RecordingError`. `unit_conversion` has the steps from a number in a file to a joint
angle.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from runtime.common.files import replacing
from runtime.errors import RecordingError
from runtime.library import Array, Integers
from runtime.recording import log_files
from runtime.recording.consistency import check_consistency
from runtime.recording.formats import FORMATS, format_of_folder
from runtime.recording.formats.tables import Tables
from runtime.recording.log_files import LogFiles, parts_of
from runtime.recording.recipes.recipe import Recipe, Signal
from runtime.recording.recipes.recipe_file import bundled_names, load_recipe
from runtime.recording.recording import Recording, require_recording
from runtime.recording.unit_conversion import converted, usable_rows

GivenRecipe = str | Path | Recipe | None  # name, file or record; None: that of the log, if any


def read_recording(
    path: str | Path, recipe: GivenRecipe = None, run: str | None = None, joints: Sequence[str] = ()
) -> Recording:
    """Read a recording from a file, a folder of raw files, a bag, or the name of a known data set.

    Without a recipe a CSV has the header `t,q1…qn` with optional `dq1…`, `ddq1…`, `tau1…`, and an
    NPZ the arrays `t, q, dq, ddq, tau` with one row per instant; both in SI units, joint side, τ
    with the sign of the inverse dynamics. A Parquet file has the columns of either; an MCAP file or
    a ROS bag has messages `sensor_msgs/JointState`. A folder is read with the recipe given, else
    with its recipe.toml, else with the bundled one of its name.

    Args:
        path: file, bag, folder, or a name such as "fr3_simulated" or "panda_gaz".
        recipe: TOML file, name of a bundled recipe, or a `Recipe`.
        run: which run, where the recipe describes several.
        joints: names in the order of the robot, which select joints of a bag where the recipe does
            not.

    Returns:
        SI units, joint side, in the joint order of the recipe.

    Raises:
        RecordingError: what was expected, what came and what to do.
    """
    return check_consistency(recording_of(read_raw(path, recipe, run, joints)))


def read_further(
    path: str | Path,
    recipe: GivenRecipe,
    run: str | None,
    joints: Sequence[str],
    remembered: Recipe | None,
) -> Recording:
    """Read a log, where no recipe is given by that of an earlier log, if its columns are there.

    Numbers of columns fit to any file: such a recipe is for files that have no header.
    """
    if recipe is not None or remembered is None:
        return read_recording(path, recipe, run, joints)
    parts = remembered.signals().values()
    is_named = all(isinstance(column, str) for part in parts for column in part.columns)
    described = str(path) in log_files.known_names() or (Path(path) / "recipe.toml").is_file()
    ways = (None, remembered) if described or not is_named else (remembered, None)
    for way in ways:
        with suppress(RecordingError):
            return read_recording(path, way, run, joints)
    return read_recording(path, None if described else remembered, run, joints)


@dataclass(frozen=True, slots=True, eq=False)
class Raw:
    """Content of the files before any conversion."""

    plan: Recipe  # which part of which file is what, in which unit, sign, order and gear
    recipe: Recipe | None  # as chosen, None by the default convention
    tables: Tables  # signal ("time", "position", …) → rows, in the files' units
    kept: Integers  # the rows that are whole in all of them
    dropped: tuple[str, ...]  # sentences about the others
    names: dict[str, tuple[str, ...]]  # texts of our NPZ, or joint names of a bag
    motors: NDArray | None  # directions of coupled motors, of an NPZ by `write_recording`
    name: str  # of the recording
    source: Mapping[str, str]  # file name → sha256
    pins: tuple[str, ...]  # sentences about files that are not the published ones
    said: tuple[str, ...]  # sentences about what the default convention does not read

    @property
    def values(self) -> dict[str, Array]:
        """Kind → the whole rows, (N, m)."""
        return {kind: table.values[self.kept] for kind, table in self.tables.items()}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences about the form of the files."""
        of_tables = (said for t in self.tables.values() for said in t.remarks)
        return tuple(dict.fromkeys((*of_tables, *self.said)))


def read_raw(
    path: str | Path, recipe: GivenRecipe = None, run: str | None = None, joints: Sequence[str] = ()
) -> Raw:
    """Rows of the files before any conversion."""
    place, chosen = place_and_recipe(path, recipe, run)
    files = LogFiles(place, chosen or Recipe(), tuple(joints))
    plan = files.plan()
    tables = {kind: files.table(kind, part) for kind, part in parts_of(plan).items()}
    extras = files.extras()
    if extras.columns is not None:
        tables["columns"] = extras.columns
    kept, dropped = usable_rows(tables)
    return Raw(
        plan=plan,
        recipe=chosen,
        tables=tables,
        kept=kept,
        dropped=tuple(dropped),
        names=extras.texts,
        motors=extras.motors if extras.columns is not None else None,
        name=extras.texts.get("name", ("",))[0] or plan.name or place.stem,
        source=files.sha256,
        pins=tuple(files.pin_notes()),
        said=files.remarks(),
    )


def recording_of(raw: Raw) -> Recording:
    """Recording with the units, signs, order and gear of the plan, without further checks."""
    names = raw.names.get("column_names", ()) if "columns" in raw.tables else ()
    recording = converted(
        raw.plan,
        raw.tables,
        column_names=names,
        motors=raw.motors,
        name=raw.name,
        joint_names=raw.plan.joints or raw.names.get("joint_names", ()),
        source=raw.source,
        recipe=raw.recipe,
    )
    rate = f" at {recording.rate_hz:.6g} Hz (median)" if len(recording) > 1 else ""
    size = f"{len(recording)} rows of {recording.n_joints} joints{rate}"
    history = (*raw.names.get("history", ()), f"Read {size} from {', '.join(raw.source)}.")
    return recording.replace(history=(*history, *raw.remarks, *recording.history, *raw.pins))


def plan_of(path: str | Path, recipe: GivenRecipe = None, run: str | None = None) -> Recipe:
    """Complete recipe by which a log is read, with the default convention written out."""
    place, chosen = place_and_recipe(path, recipe, run)
    plan = LogFiles(place, chosen or Recipe()).plan()
    return (chosen or Recipe()).replace(
        time=plan.time, run=plan.run, law=plan.law, **plan.signals()
    )


def place_and_recipe(
    path: str | Path, recipe: GivenRecipe, run: str | None
) -> tuple[Path, Recipe | None]:
    """Path of a log, and the recipe by which it is read."""
    place = locate(path)
    chosen = _choose_recipe(place, recipe)
    if run is None:
        return place, chosen
    if chosen is None or not any("{run}" in part.file for part in parts_of(chosen).values()):
        raise RecordingError(
            f"'{place}' has no runs to choose '{run}' from, only a recipe with {{run}} in its file "
            "names has; leave the run out"
        )
    return place, chosen.replace(run=run)


def locate(path: str | Path) -> Path:
    """The existing path, or the place of the known data set of that name."""
    if not isinstance(path, str | PathLike):
        raise RecordingError(f"expected the path or name of a log, got {path!r:.60}")
    place, is_there = Path(path), False
    with suppress(OSError):  # a name that is too long
        if place.is_file() or place.is_dir():
            return place
        is_there = place.exists()
    if is_there:
        raise RecordingError(
            f"'{path}' is a pipe or a device, expected a file or a folder; write the log to a file"
        )
    if str(path) in log_files.known_names():
        return log_files.locate(str(path))
    raise RecordingError(
        f"there is no file or folder {str(path)!r}; give a path, "
        f"or one of the known data sets {', '.join(log_files.known_names())}"
    )


def _choose_recipe(place: Path, recipe: GivenRecipe) -> Recipe | None:
    """The requested recipe, else the recipe.toml of a folder, else the bundled one of its name."""
    if recipe is not None:
        return load_recipe(recipe)
    if not place.is_dir():
        return None
    if (place / "recipe.toml").is_file():
        return load_recipe(place / "recipe.toml")
    if format_of_folder(place) is not None:
        return None
    if place.resolve().name in bundled_names():
        return load_recipe(place.resolve().name)
    raise RecordingError(
        f"the folder '{place}' has no recipe that describes its files; write "
        f"{place / 'recipe.toml'} with [time], [position] and [torque] (file, columns, unit), "
        "after the example of the bundled recipes"
    )


def mean_of_column(log: str | Path, recipe: GivenRecipe, run: str | None, name: str) -> float:
    """Mean of the finite numbers of one column of a log, in the unit of the file."""
    place, chosen = place_and_recipe(log, recipe, run)
    files = LogFiles(place, chosen or Recipe())
    file = "" if chosen is None or chosen.position is None else chosen.position.file
    values = files.table("temperature", Signal("", file=file, key=name, columns=(name,))).values
    finite = values[np.isfinite(values)]
    if not finite.size:
        raise RecordingError(
            f"expected numbers in the column '{name}' of '{log}', got none; name another column"
        )
    return float(finite.mean())


def write_recording(recording: Recording, path: str | Path) -> None:
    """Write CSV, NPZ or Parquet, by the suffix of the path.

    Args:
        recording: SI units, joint side.
        path: of the file; missing folders are made.

    Raises:
        RecordingError: another suffix, or Parquet without its library.
    """
    require_recording(recording)
    if not isinstance(path, str | Path):
        raise RecordingError(f"expected the path of a file, got {path!r:.60}")
    path = Path(path)
    writers = {each.suffixes[0]: each.write for each in FORMATS.records() if each.write}
    if path.suffix not in writers:
        raise RecordingError(
            f"expected a path that ends in {', '.join(writers)}, got {path.name!r}; rename it"
        )
    with replacing(path) as file:
        writers[path.suffix](recording, file)
