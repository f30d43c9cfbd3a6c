"""The proposed recipe as TOML for `identify --recipe`, with the findings as comments.

Values that only the user has (gears, the zero of motor angles) are a block to be filled in.
"""

import dataclasses
import textwrap
from collections.abc import Sequence

from runtime.inspection.finding import ERROR, WARNING
from runtime.inspection.inspection import Inspection
from runtime.recording import Recipe
from runtime.recording.formats import format_of_suffix
from runtime.recording.formats.text_tables import numbers_in
from runtime.recording.log_files import LogFiles
from runtime.recording.reader import locate
from runtime.recording.recipes.recipe import JSON_CELLS
from runtime.recording.recipes.recipe_file import toml_value

_TABLES = (
    *("time", "position", "velocity", "acceleration", "torque", "gear"),
    *("preparation", "split", "friction"),
)
MOST_FILES = 12
"""Files of a folder whose columns a skeleton lists."""
_KEYS = ("description", "robot", "run", "joints", "leave_out")


def recipe_text(inspection: Inspection) -> str:
    """TOML of the proposed recipe; its comments are to be read before it is used."""
    plan = inspection.plan
    blind = any(f.kind == "missing_clock" and f.level == ERROR for f in inspection.findings)
    todo = inspection.of_level(ERROR, WARNING)
    what = "its findings:" if todo else "it found nothing wrong."
    lines = [f"# Proposed by python -m runtime inspect; {what}"]
    for finding in todo:
        text = f"{finding.level}: {finding.sentence}"
        lines += textwrap.wrap(text, 96, initial_indent="#   ", subsequent_indent="#     ")
    lines.append("")
    lines += [f"{key} = {toml_value(getattr(plan, key))}" for key in _KEYS if getattr(plan, key)]
    for name in _TABLES:
        table = _table(plan, name)
        if name == "time" and blind:
            lines += [
                "",
                "[time]",
                "# The rate of the logger, which the files do not contain:",
                "# rate_hz =",
            ]
            continue
        if table:
            lines += ["", f"[{name}]", *(f"{key} = {value}" for key, value in table.items())]
    if any(f.kind == "position_range" for f in inspection.findings) and not plan.gear:
        lines += _gear_stub(len(inspection.recording.q[0]))
    return "\n".join(lines) + "\n"


def skeleton_text(log: str, joints: Sequence[str]) -> str:
    """TOML of a recipe to be filled in, with the columns or arrays of the file as comments."""
    place = locate(log)
    file: tuple[str, ...] = () if place.is_file() else ('file = "…"',)
    more = file
    named = ", ".join("…" for _ in joints)
    lines = [f"# Columns and units of {place.name} were not understood; state them, then identify."]
    files = LogFiles(place, Recipe())
    names = [place.name] if place.is_file() else sorted(p.name for p in place.iterdir())
    for name in (each for each in names[:MOST_FILES] if format_of_suffix(each)):
        reader = files.reader(name, "")
        arrays = [f"{key}  {list(shape)}" for key, shape in reader.arrays().items()]
        rows = reader.head()[:2]
        cells = [
            f"{k}  {'  '.join(column)}"[:96] for k, column in enumerate(zip(*rows, strict=False))
        ]
        if named != '"…"' and any(numbers_in(cell) for row in rows for cell in row):
            more = (*more, f'cells = "{JSON_CELLS}"')  # each signal is one column of lists
            named = '"…"'
        lines += [f"# {name} holds:", *(f"#   {each}" for each in arrays or cells)]
    order = f"Columns stand in the order of the joints: {', '.join(joints)}. Where the log lacks"
    order += " some, build the robot without them: --base, --tip, --lock."
    lines += textwrap.wrap(order, 96, initial_indent="# ", subsequent_indent="#   ")
    tables = {
        "time": (*file, "column = 0", 'unit = "s"'),
        "position": (f"columns = [{named}]", *more, 'unit = "rad"'),
        "torque": (f"columns = [{named}]", *more, 'unit = "N*m"'),
    }
    for name, keys in tables.items():
        lines += ["", f"# [{name}]", *(f"# {key}" for key in keys)]
    return "\n".join(lines) + "\n"


def _table(plan: Recipe, name: str) -> dict[str, str]:
    """Entries of one table that are not the default."""
    if name == "gear":
        return {"matrix": toml_value(plan.gear)} if plan.gear else {}
    part = plan.law if name == "torque" and plan.law is not None else getattr(plan, name)
    if part is None:
        return {}
    entries = {}
    for item in dataclasses.fields(part):
        value = getattr(part, item.name)
        default = item.default
        needed = item.name in {"unit", "columns"} and value not in ("", ())
        if name == "friction" and item.name == "gear":
            continue
        if value is not None and (needed or value != default):
            entries[item.name] = toml_value(value)
    return entries


def _gear_stub(n: int) -> list[str]:
    rows = [
        "#     [" + ", ".join("1.0" if i == j else "0.0" for j in range(n)) + "]," for i in range(n)
    ]
    return [
        "",
        "# If these are motor angles and motor torques, take the gears from the manufacturer.",
        "# Write R of q_motor = R q_joint (the row of a motor that turns with another joint has",
        "# two entries), and under [position] the offset of the zero of each joint, in rad; then",
        "# inspect again with --recipe, which proposes the filter and the friction, too.",
        "# [gear]",
        "# matrix = [",
        *rows,
        "# ]",
    ]
