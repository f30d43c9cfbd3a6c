"""Parts of log files that may be a signal, by names, shapes and content of columns."""

import re
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from runtime.inspection.checks.column_content import Block, blocks_by_content
from runtime.inspection.checks.column_names import Meaning, by_joint, meaning
from runtime.recording import Recipe
from runtime.recording.formats import format_of_suffix
from runtime.recording.formats.log_format import LogReader
from runtime.recording.log_files import LogFiles
from runtime.recording.recipes.recipe import Signal

Group = dict[str, list[dict]]


def signal_parts(place: Path, names: tuple[str, ...]) -> Group:
    """Parts of a log by the kind of signal that they may be."""
    signals: Group = defaultdict(list)
    files = [place]
    if place.is_dir():
        files = sorted(place.iterdir())
    for path in files:
        file = path.name if place.is_dir() else ""
        if has_titles(path):
            reader = LogFiles(path, Recipe()).reader(path.name, "")
            for kind, part in (*_arrays(reader, file, len(names)), *_texts(reader, file, names)):
                signals[kind].append(part)
    for parts in signals.values():
        parts.sort(key=lambda part: not part["measured"])
    return signals


def has_titles(path: Path) -> bool:
    """Whether a recipe can be proposed from the titles in a file."""
    log_format = format_of_suffix(path.name)
    return log_format is not None and log_format.has_titles


def _arrays(reader: LogReader, file_name: str, joints: int) -> Iterable[tuple[str, dict]]:
    log_format = format_of_suffix(reader.raw.name)
    layout = "npz" if log_format is None else log_format.name
    for key, shape in reader.arrays().items():
        what = meaning(key)
        width = shape[1] if len(shape) == 2 else 1
        wanted = 1 if what.kind == "time" else joints
        if what.kind and len(shape) in {1, 2} and width == wanted:
            yield what.kind, _part(what, file_name, key, layout=layout, key=key)


def _texts(reader: LogReader, file_name: str, names: tuple[str, ...]) -> Iterable[tuple[str, dict]]:
    joints = len(names)
    path, rows = reader.raw.path, reader.head()
    file = meaning(path.stem)
    numeric = [all(_is_number(cell) for cell in row) for row in rows]
    first = next((i for i, good in enumerate(numeric) if good), None)
    if first is None:
        return
    width = len(rows[first])
    if width == 1 and file.kind:  # one number per line
        part = {"layout": "flat"} | ({} if file.kind == "time" else {"width": joints})
        yield file.kind, _part(file, file_name, path.name, **part)
        return
    header = next((row for row in reversed(rows[:first]) if len(row) == width), None)
    if header is not None:
        yield from _titled(header, names, file_name, path.name, file)
    elif width == joints and file.kind:
        yield (
            file.kind,
            _part(file, file_name, path.name, layout="csv", columns=tuple(range(width))),
        )
    else:
        table = reader.table(
            "position", Signal(unit="rad", layout="csv", columns=tuple(range(width)))
        )
        blocks = blocks_by_content(table.values, joints)
        if blocks:
            yield from _recognised(blocks, file_name, path.name)
        else:
            yield from _untitled(width, file_name, path.name, joints)


def _recognised(blocks: tuple[Block, ...], file_name: str, name: str) -> Iterable[tuple[str, dict]]:
    """Signals of columns without titles, by their content."""
    for block in blocks:
        first = block.columns[0]
        where: dict = {"columns": block.columns}
        if block.kind == "time":
            where = {"column": first}
        if block.kind:
            what = Meaning("", -1, True, block.unit)
            part = _part(what, file_name, f"{name}: column {first}", layout="csv", **where)
            yield block.kind, part | {"blocks": blocks}


def _titled(
    header: list[str], names: tuple[str, ...], file_name: str, name: str, file: Meaning
) -> Iterable[tuple[str, dict]]:
    """Signals of titles that differ in the joint's name, or only in their last number."""
    named = by_joint(header, names)
    groups: dict[str, list[tuple[int, str]]] = defaultdict(list)
    for title in header:
        if not any(title in titles for titles in named.values()):
            stem = re.sub(r"\d+(?=\D*$)", "#", title)
            groups[stem].append((meaning(title).joint, title))
    numbered = {stem: tuple(t for _, t in sorted(members)) for stem, members in groups.items()}
    for stem, titles in (named | numbered).items():
        what = meaning(stem.replace("#", "1"))
        kind = what.kind or (file.kind if len(titles) > 1 else "")
        if kind == "time":
            yield kind, _part(what, file_name, stem, layout="csv", column=titles[0])
        elif kind:
            yield kind, _part(what, file_name, f"{name}: {stem}", layout="csv", columns=titles)


def _untitled(width: int, file_name: str, name: str, joints: int) -> Iterable[tuple[str, dict]]:
    """Signals of columns without titles: at most one of time, then q τ, q dq τ or q dq ddq τ."""
    blocks, clock = divmod(width, joints)
    orders: dict[int, tuple[str, ...]] = {
        2: ("position", "torque"),
        3: ("position", "velocity", "torque"),
        4: ("position", "velocity", "acceleration", "torque"),
    }
    if clock > 1 or blocks not in orders:
        return
    unnamed = Meaning("", -1, True, "")
    if clock:
        yield "time", _part(unnamed, file_name, "column 0", layout="csv", column=0)
    for k, kind in enumerate(orders[blocks]):
        first = clock + k * joints
        columns = tuple(range(first, first + joints))
        yield kind, _part(unnamed, file_name, f"{name}: {first}…", layout="csv", columns=columns)


def _part(what: Meaning, file: str, title: str, **where: object) -> dict:
    return {
        "title": title,
        "measured": what.is_measured and meaning(file.rsplit(".", 1)[0]).is_measured,
        "unit": what.unit,
        "where": {"file": file, **where},
    }


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
