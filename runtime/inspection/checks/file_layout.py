"""A first recipe for files without one: which file, column or array is which signal.

Only names and shapes are used, with SI units unless a title names another; the other checks compare
the numbers. Measured signals are preferred to commanded ones. Joints are ordered by their numbers,
whatever the order of the columns. Files whose names differ in their last number only, such as
`log_1.csv`, are runs of one folder.
"""

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from runtime.common.texts import number_of
from runtime.errors import RecordingError
from runtime.inspection.checks.columns import (
    RATED,
    ColumnBlock,
    Meaning,
    blocks_by_content,
    by_joint,
    meaning,
)
from runtime.inspection.finding import ERROR, INFO, WARNING, Checked, Finding
from runtime.recording import Recipe
from runtime.recording.formats import format_of_suffix
from runtime.recording.formats.log_format import LogReader
from runtime.recording.formats.text_tables import numbers_in
from runtime.recording.log_files import LogFiles
from runtime.recording.recipes.recipe import JSON_CELLS, SI, ControlLaw, Signal, Time

_NO_CLOCK = Time(rate_hz=1.0)
_NUMBER = re.compile(r"\d+(?=\D*$)")
_CURRENT = re.compile(  # word for a motor current; current_torque is the present torque
    r"(?<![a-z])(curr|currents?|amps?|amperes?)(?![a-z])(?!.*(torque|effort|tau))"
)
Group = dict[str, list[dict]]


def draft(
    place: Path, names: tuple[str, ...], rate_hz: float | None = None
) -> tuple[Recipe | None, list[Finding]]:
    """Draft a recipe from names and shapes."""
    if place.is_file() and not has_titles(place):
        return None, []
    plan = _by_convention(place, names)
    if plan is not None and (plan.torque is not None or plan.law is not None):
        return None, []
    joints = len(names)
    described = signal_parts(place, names)
    if plan is not None and not described.get("torque") and _law_of(described)[0] is None:
        return None, []  # no other title names a torque or commands either
    return _recipe(place, described, joints, rate_hz)


def _by_convention(place: Path, names: tuple[str, ...]) -> Recipe | None:
    """The recipe of a file that follows the default convention and has a clock."""
    if not place.is_file():
        return None
    try:
        files = LogFiles(place, Recipe(), names)
        plan = files.plan()
        timed = plan.time is not None and len(files.table("time", plan.time).values)
    except RecordingError:
        return None
    return plan if timed else None


def _by_content(blocks: tuple[ColumnBlock, ...]) -> Finding:
    """Signals assigned to the columns of a file without header; `inspect` shows them as a table."""
    rows = [
        {"columns": list(each.columns), "signal": each.kind or None, "reason": each.reason}
        for each in blocks
    ]
    spans = ", ".join(
        f"{each.kind} {each.columns[0]}" + (f"–{each.columns[-1]}" if each.columns[1:] else "")
        for each in blocks
        if each.kind
    )
    sentence = (
        "the file has no titles that name the signals of all joints; its columns, counted from 0, "
        "were assigned by their content: "
        f"{spans}; check them, and correct them in the recipe that --recipe-out writes"
    )
    return Finding("columns_by_content", WARNING, sentence, {"table": rows})


def _clock_by_content(signals: Group) -> list[Finding]:
    """The clock of a file whose titles name other signals but no time."""
    part = signals["time"][0]
    if "blocks" not in part or "blocks" in signals["position"][0]:
        return []
    (clock,) = (each for each in part["blocks"] if each.kind == "time")
    sentence = (
        f"no title names a time: the column '{part['where']['column']}', which {clock.reason}, is "
        f"taken for the time in {clock.unit}; correct it under [time] of the recipe if it is not"
    )
    return [Finding("clock_by_content", WARNING, sentence)]


def _incomplete(kind: str, part: dict, joints: int) -> Finding:
    first, *others = part["where"]["columns"]
    count = f"{len(others) + 1} columns ({first} … {others[-1]})" if others else "one column"
    sentence = (
        f"{part['title']} is named like a {kind} but has {count} for {joints} joints, so it is "
        "not used; log every joint, or describe it in a recipe"
    )
    return Finding("incomplete_signal", WARNING, sentence)


def _recipe(place: Path, signals: Group, joints: int, rate_hz: float | None) -> Checked:
    def wide(part: dict) -> bool:
        where = part["where"]
        return "cells" in where or len(where.get("columns", ())) in {0, joints}

    findings: list[Finding] = []
    for kind, parts in signals.items():
        if kind != "time":
            signals[kind] = [part for part in parts if wide(part)]
            if not signals[kind]:
                findings += [_incomplete(kind, part, joints) for part in parts[:1]]
    if not signals.get("position"):
        raise RecordingError(
            f"expected columns, arrays or files of {joints} joint positions in {place.name}, named "
            "like q1 …, position or angle, got none; describe the files in a recipe"
        )
    if "blocks" in signals["position"][0]:
        findings.append(_by_content(signals["position"][0]["blocks"]))
    chosen: dict[str, Signal] = {}
    run = ""
    for kind, parts in signals.items():
        if kind == "time" or not parts:
            continue
        if kind == "acceleration":
            sentence = (
                f"the accelerations '{parts[0]['title']}' are not used: loggers compute them with "
                "an unknown filter; they are computed again with the filter of the other signals"
            )
            findings.append(Finding("left_aside", INFO, sentence, {"kind": "acceleration"}))
            continue
        where, many = run_of(parts)
        if many and not run:
            findings.append(several_runs(parts, many))
        run = run or many
        known, unsure = _unit_of(kind, parts[0])
        chosen[kind] = Signal(**known, **where)
        findings += [*unsure, *_left_aside(kind, parts, many)]
    time = _NO_CLOCK
    if signals.get("time"):
        where, _ = run_of(signals["time"])
        findings += _clock_by_content(signals)
        time = Time(unit=signals["time"][0]["unit"] or "s", from_zero=True, **where)
    elif rate_hz is not None:
        time = Time(rate_hz=rate_hz)
    elif "velocity" not in chosen:
        sentence = (
            "the log has no column of time, and no velocity to compute its rate from; give the "
            "rate of the logger by --settings log_rate=HZ, or write rate_hz under [time] of "
            "the recipe"
        )
        findings.append(Finding("missing_clock", ERROR, sentence))
    law, stated = _law_of(signals) if "torque" not in chosen else (None, [])
    recipe = Recipe(run=run, time=time, law=law, **chosen)  # type: ignore[arg-type]
    return recipe, findings + stated


def _law_of(signals: Group) -> tuple[ControlLaw | None, list[Finding]]:
    """A law with kp = 1 where commanded positions lie beside the measured ones."""
    parts = signals.get("position") or []
    for part in parts[1:]:
        where = part["where"]
        names = where.get("key") or where.get("columns")
        if part["measured"] or where["file"] != parts[0]["where"]["file"] or not names:
            continue
        sentence = (
            f"the log has no torque, but the commands '{part['title']}': a law with kp = 1 and "
            "kd = 0 is taken; write the gains under [torque] of the recipe where they are known"
        )
        law = ControlLaw(law="pd", kp=1.0, kd=0.0, q_des=names)
        return law, [Finding("unknown_gains", WARNING, sentence, {"title": part["title"]})]
    return None, []


def _unit_of(kind: str, part: dict) -> tuple[dict[str, Any], list[Finding]]:
    """Unit of a signal, with a finding where the name says current and nothing states the unit."""
    unit = part["unit"]
    if unit in {"A", "mA"}:
        return {"unit": unit}, []
    if unit == RATED:
        sentence = (
            f"'{part['title']}' states a share of a rated torque or current that the file does not "
            "contain: a current in A with unknown gains is proposed, which identify estimates; "
            'where the rated torques are known, write unit = "N*m" and as gain the torque of one '
            "unit at every joint under [torque] of the recipe"
        )
        evidence = {"title": part["title"]}
        return {"unit": "A"}, [Finding("current_unit", WARNING, sentence, evidence)]
    names = (part["where"]["file"], part["title"])
    name = next((name for name in names if _CURRENT.search(name.lower())), "")
    if kind != "torque" or unit or not name:
        return {"unit": unit or SI[kind]}, []
    sentence = (
        f"'{name}' is named like a motor current and states no unit: A with unknown gains is "
        "proposed, which identify estimates; where the values are torques, write "
        'unit = "N*m" under [torque] of the recipe'
    )
    return {"unit": "A"}, [Finding("current_unit", WARNING, sentence, {"title": name})]


def _left_aside(kind: str, parts: list[dict], run: str) -> list[Finding]:
    others = [p["title"] for p in parts[1:] if not (run and p["measured"])]
    others = list(dict.fromkeys(others))
    if not others:
        return []
    sentence = f"{kind} is read from '{parts[0]['title']}'; not used: {', '.join(others[:6])}"
    evidence = {"kind": kind, "chosen": parts[0]["title"], "others": others}
    return [Finding("left_aside", INFO, sentence, evidence)]


def run_of(parts: list[dict[str, Any]]) -> tuple[dict[str, Any], str]:
    """Place of the first part, with `{run}` for the number in which the files differ."""
    where = dict(parts[0]["where"])
    files = [str(part["where"]["file"]) for part in parts if part["measured"]]
    match = _NUMBER.search(str(where["file"]))
    if len({_NUMBER.sub("#", name) for name in files}) == 1 and len(set(files)) > 1 and match:
        where["file"] = where["file"][: match.start()] + "{run}" + where["file"][match.end() :]
        return where, match[0]
    return where, ""


def several_runs(parts: list[dict[str, Any]], run: str) -> Finding:
    """Finding on a folder of several runs: the one that is read, and how to read the others."""
    files = [str(part["where"]["file"]) for part in parts if part["measured"]]
    names = sorted({_NUMBER.findall(name)[0] for name in files}, key=int)
    sentence = (
        f"the folder contains the runs {', '.join(names)}; without --run, run {run} is "
        f"inspected; identify from all of them with --run {','.join(names)}"
    )
    return Finding("several_runs", INFO, sentence, {"runs": names, "inspected": run})


def signal_parts(place: Path, names: tuple[str, ...]) -> Group:
    """Parts of a log by the kind of signal that they may be."""
    signals: Group = defaultdict(list)
    for path in sorted(place.iterdir()) if place.is_dir() else [place]:
        file = path.name if place.is_dir() else ""
        if has_titles(path):
            reader = LogFiles(path, Recipe()).reader(path.name, "")
            for kind, part in (*_arrays(reader, file, len(names)), *_texts(reader, file, names)):
                if path.suffix.lower() == ".parquet":
                    part["where"]["layout"] = "parquet"
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
    if lists := [*_of_lists(rows, joints, file_name, path.name)]:
        yield from lists
        return
    kept = _numeric_columns(rows)
    numeric = [len(row) > kept[-1] and all(_is_number(row[k]) for k in kept) for row in rows]
    first = next((i for i, good in enumerate(numeric) if good), None)
    if first is None:
        return
    width = len(rows[first])
    if width == 1 and file.kind:  # one number per line
        part = {"layout": "flat"} | ({} if file.kind == "time" else {"width": joints})
        yield file.kind, _part(file, file_name, path.name, **part)
        return
    header = next((row for row in reversed(rows[:first]) if len(row) == width), None)
    titled = [] if header is None else [*_titled(header, names, file_name, path.name, file)]
    whole = {kind for kind, part in titled if len(part["where"].get("columns", ())) == joints}
    # a file of a folder may hold one signal only
    alone = header is not None and not file_name and "position" not in whole
    unknown = alone and len(set(header or ())) == width
    blocks = _blocks(reader, kept, joints) if unknown else ()
    if header is not None and blocks:  # titles of another language or vendor
        yield from _recognised(blocks, file_name, path.name, header)
    elif header is not None:
        yield from titled
        if not file_name and len(set(header)) == width and "time" not in {k for k, _ in titled}:
            seen = _recognised(_blocks(reader, kept, joints), file_name, path.name, header)
            yield from (part for part in seen if part[0] == "time")
    elif width == joints and file.kind:
        yield (
            file.kind,
            _part(file, file_name, path.name, layout="csv", columns=tuple(range(width))),
        )
    else:
        blocks = _blocks(reader, kept, joints)
        if blocks:
            yield from _recognised(blocks, file_name, path.name)
        elif kept[-1] == len(kept) - 1:  # text stands behind the numbers
            yield from _untitled(len(kept), file_name, path.name, joints)


def _of_lists(
    rows: list[list[str]], joints: int, file_name: str, name: str
) -> Iterable[tuple[str, dict]]:
    """Signals of a table with a header whose cells are JSON lists, one number per joint."""
    row = next((row for row in rows if any(map(numbers_in, row))), [])
    header = rows[0] if row else []
    if len(header) != len(row):
        return
    for title, cell in zip(header, row, strict=True):
        what = meaning(title)
        if what.kind and len(numbers_in(cell)) == joints:
            where = {"columns": (title,), "cells": JSON_CELLS}
            yield what.kind, _part(what, file_name, f"{name}: {title}", layout="csv", **where)
        elif what.kind == "time" and _is_number(cell):
            yield "time", _part(what, file_name, title, layout="csv", column=title)


def _numeric_columns(rows: list[list[str]]) -> tuple[int, ...]:
    """Columns of the usual width that hold numbers; others are text, or empty at the end."""
    width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    usual = [row for row in rows if len(row) == width]
    return tuple(k for k in range(width) if any(_is_number(row[k]) for row in usual)) or (0,)


def _blocks(reader: LogReader, kept: tuple[int, ...], joints: int) -> tuple[ColumnBlock, ...]:
    """Columns of a table by their content; none of cells that are no numbers."""
    signal = Signal(unit="rad", layout="csv", columns=kept)
    try:
        blocks = blocks_by_content(reader.table("position", signal).values, joints)
    except RecordingError:
        return ()
    return tuple(replace(each, columns=tuple(kept[k] for k in each.columns)) for each in blocks)


def _recognised(
    blocks: tuple[ColumnBlock, ...], file_name: str, name: str, header: Sequence[str] = ()
) -> Iterable[tuple[str, dict]]:
    """Signals of columns without titles that are understood, by their content."""
    for block in blocks:
        first = block.columns[0]
        columns = tuple(header[k] for k in block.columns) if header else block.columns
        where: dict = {"columns": columns}
        if block.kind == "time":
            where = {"column": columns[0]}
        if block.kind:
            units = tuple(meaning(f"{block.kind} {title}").unit for title in columns if header)
            stated = units[:1] if len({*units}) < 2 else ()
            what = Meaning("", -1, True, "".join(stated) or block.unit)
            part = _part(what, file_name, f"{name}: column {first}", layout="csv", **where)
            if all(units) and not stated:  # a slide in mm beside hinges in degrees
                part["unit"] = units
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
    return number_of(cell.replace(",", ".")) is not None
