"""Files → `Recording`: units, signs, joint order and gear are settled at this door, once.

Corrupt rows are dropped, counted and told; whatever cannot be a recording is one sentence of
`RecordingError`. `conversion` has the steps from a number in a file to a joint angle.
"""

from collections.abc import Sequence
from pathlib import Path

from runtime import datasets
from runtime.errors import RecordingError
from runtime.recording.consistency import check_consistency
from runtime.recording.conversion import converted
from runtime.recording.files import Files, is_bag, parts_of
from runtime.recording.recipe import Recipe
from runtime.recording.recipe_file import bundled_names, load_recipe
from runtime.recording.recording import Recording


def read_recording(
    path: str | Path,
    recipe: str | Path | Recipe | None = None,
    run: str | None = None,
    joints: Sequence[str] = (),
) -> Recording:
    """A recording from a file, a folder of raw files, a bag, or the name of a known data set.

    Without a recipe a CSV has the header `t,q1…qn` with optional `dq1…`, `ddq1…`, `tau1…`, and an
    NPZ the arrays `t, q, dq, ddq, tau` with one row per instant; both in SI units, joint side,
    τ with the sign of the inverse dynamics. A Parquet file has the columns of either; an MCAP file
    or a ROS bag tells `sensor_msgs/JointState`; `convention` has the details. A folder is read with
    the recipe given, else with its own recipe.toml, else with the bundled one of its name.

    Args:
        path: CSV, NPZ, Parquet, MCAP, bag, folder, or a name such as "panda_gaz".
        recipe: TOML file, name of a bundled recipe, or a `Recipe`.
        run: which run, where the recipe knows several.
        joints: names in the order of the robot, which pick joints of a bag where no recipe does.

    Raises:
        RecordingError: in one sentence what was expected, what came and what to do.
    """
    place, chosen = place_and_recipe(path, recipe, run)
    files = Files(place, chosen or Recipe(), tuple(joints))
    plan = files.plan()
    raw = {kind: files.table(kind, part) for kind, part in parts_of(plan).items()}
    extras = files.extras()
    if (columns := files.columns()) is not None:
        raw["columns"] = columns
    names = extras.get("column_names", ())
    data = converted(plan, raw, len(names))
    recording = Recording(
        t=data.t,
        **data.signals,
        column_names=names if columns is not None else (),
        motors=files.motors() if columns is not None else None,
        name=extras.get("name", ("",))[0] or plan.name or place.stem,
        joint_names=plan.joints or extras.get("joint_names", ()),
        source=files.sha256,
        recipe=chosen,
    )
    rate = f" at {recording.rate_hz:.6g} Hz (median)" if len(recording) > 1 else ""
    size = f"{len(recording)} rows of {recording.n_joints} joints{rate}"
    remarks = dict.fromkeys(remark for table in raw.values() for remark in table.remarks)
    history = (*extras.get("history", ()), f"Read {size} from {', '.join(files.sha256)}.")
    history += (*remarks, *data.notes, *files.pin_notes())
    return check_consistency(recording.replace(history=history))


def place_and_recipe(
    path: str | Path, recipe: str | Path | Recipe | None, run: str | None
) -> tuple[Path, Recipe | None]:
    """Where a log lies, and the recipe that it is read with; arguments as for `read_recording`.

    Raises:
        RecordingError: there is no such log or recipe.
    """
    place = _locate(path)
    chosen = _choose_recipe(place, recipe)
    if chosen is not None and run is not None:
        chosen = chosen.replace(run=run)
    return place, chosen


def _locate(path: str | Path) -> Path:
    """The existing path, or the folder of the known data set of that name."""
    if Path(path).exists():
        return Path(path)
    if str(path) in bundled_names():
        return datasets.locate(str(path))
    raise RecordingError(
        f"there is no file or folder {str(path)!r}; give a path, "
        f"or one of the known data sets {', '.join(bundled_names())}"
    )


def _choose_recipe(place: Path, recipe: str | Path | Recipe | None) -> Recipe | None:
    """The recipe asked for; a folder also has its own recipe.toml, or the bundled one."""
    if recipe is not None:
        return load_recipe(recipe)
    if not place.is_dir():
        return None
    if (place / "recipe.toml").is_file():
        return load_recipe(place / "recipe.toml")
    if is_bag(place):
        return None
    if place.resolve().name in bundled_names():
        return load_recipe(place.resolve().name)
    raise RecordingError(
        f"the folder {place.name} has no recipe, so nobody knows what its files mean; write "
        f"{place.name}/recipe.toml with [time], [position] and [torque] (file, columns, unit), "
        "after the example of the bundled recipes"
    )
