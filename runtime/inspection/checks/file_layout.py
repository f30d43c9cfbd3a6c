"""Files without a recipe → a first recipe: which file, column or array is which signal.

Only names and shapes are read here, in SI units unless a title names another; whether the numbers
agree is asked afterwards. Measured signals come before commanded ones (trap 4), joints in the
order of their numbers, whatever the order of the columns (trap 9).
"""

import re
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path

from runtime.errors import RecordingError
from runtime.inspection.checks.column_names import SI, Meaning, meaning
from runtime.inspection.finding import ERROR, INFO, WARNING, Finding
from runtime.recording import Recipe
from runtime.recording.formats import format_of_suffix
from runtime.recording.formats.log_format import LogReader
from runtime.recording.log_files import LogFiles
from runtime.recording.recipes.recipe import Signal, Time

Group = dict[str, list[dict]]
_UNTOLD = Time(rate_hz=1.0)


def draft(
    place: Path, joints: int, rate_hz: float | None = None
) -> tuple[Recipe | None, list[Finding]]:
    """A recipe for the bare files (None: the default convention), and what is missing.

    Args:
        place: a file or a folder.
        joints: of the robot.
        rate_hz: of a log without a clock.

    Raises:
        RecordingError: no positions, or no file that holds numbers.
    """
    if place.is_file() and not _has_titles(place):
        return None, []
    plan = _by_convention(place)
    if plan is not None and plan.torque is not None:
        return None, []
    found = _described(place, joints)
    if plan is not None and not found.get("torque"):  # nor does another title name it
        return None, []
    return _recipe(place, found, joints, rate_hz)


def _by_convention(place: Path) -> Recipe | None:
    """The plan of a file that keeps the default convention and has a clock."""
    if not place.is_file():
        return None
    try:
        plan = LogFiles(place, Recipe()).plan()
        timed = plan.time is not None and len(LogFiles(place, plan).table("time", plan.time).values)
    except RecordingError:
        return None
    return plan if timed else None


def _described(place: Path, joints: int) -> Group:
    """kind → descriptions of the parts that may be it, measured ones first."""
    found: Group = defaultdict(list)
    files = [place]
    if place.is_dir():
        files = sorted(place.iterdir())
    for path in files:
        own = path.name if place.is_dir() else ""
        if _has_titles(path):
            reader = LogFiles(path, Recipe()).reader(path.name, "")
            for kind, part in (*_arrays(reader, own, joints), *_texts(reader, own, joints)):
                found[kind].append(part)
    for parts in found.values():
        parts.sort(key=lambda part: not part["measured"])
    return found


def _has_titles(path: Path) -> bool:
    """Whether a recipe can be proposed from the titles in a file."""
    log_format = format_of_suffix(path.name)
    return log_format is not None and log_format.has_titles


def _arrays(reader: LogReader, own: str, joints: int) -> Iterable[tuple[str, dict]]:
    for key, shape in reader.arrays().items():
        what = meaning(key)
        width = shape[1] if len(shape) == 2 else 1
        wanted = 1 if what.kind == "time" else joints
        if what.kind and len(shape) in {1, 2} and width == wanted:
            yield what.kind, _part(what, own, key, layout="npz", key=key)


def _texts(reader: LogReader, own: str, joints: int) -> Iterable[tuple[str, dict]]:
    path, rows = reader.raw.path, reader.head()
    file = meaning(path.stem)
    numeric = [all(_is_number(cell) for cell in row) for row in rows]
    first = next((i for i, good in enumerate(numeric) if good), None)
    if first is None:
        return
    width = len(rows[first])
    if width == 1 and file.kind:  # one number per line
        part = {"layout": "flat"} | ({} if file.kind == "time" else {"width": joints})
        yield file.kind, _part(file, own, path.name, **part)
        return
    header = next((row for row in reversed(rows[:first]) if len(row) == width), None)
    if header is not None:
        yield from _titled(header, own, path.name, file)
    elif width == joints and file.kind:
        yield file.kind, _part(file, own, path.name, layout="csv", columns=tuple(range(width)))
    else:
        yield from _untitled(width, own, path.name, joints)


def _titled(header: list[str], own: str, name: str, file: Meaning) -> Iterable[tuple[str, dict]]:
    """Titles that differ in their last number only are one signal, in the order of the numbers."""
    groups: dict[str, list[tuple[int, str]]] = defaultdict(list)
    for title in header:
        stem = re.sub(r"\d+(?=\D*$)", "#", title)
        groups[stem].append((meaning(title).joint, title))
    for stem, members in groups.items():
        titles = tuple(title for _, title in sorted(members))
        what = meaning(stem.replace("#", "1"))
        kind = what.kind or (file.kind if len(titles) > 1 else "")
        if kind == "time":
            yield kind, _part(what, own, stem, layout="csv", column=titles[0])
        elif kind:
            yield kind, _part(what, own, f"{name}: {stem}", layout="csv", columns=titles)


def _untitled(width: int, own: str, name: str, joints: int) -> Iterable[tuple[str, dict]]:
    """Blocks of n columns behind at most one of time: q τ, q dq τ, or q dq ddq τ."""
    blocks, clock = divmod(width, joints)
    orders: dict[int, tuple[str, ...]] = {
        2: ("position", "torque"),
        3: ("position", "velocity", "torque"),
        4: ("position", "velocity", "acceleration", "torque"),
    }
    if clock > 1 or blocks not in orders:
        return
    silent = Meaning("", -1, True, "")
    if clock:
        yield "time", _part(silent, own, "column 0", layout="csv", column=0)
    for k, kind in enumerate(orders[blocks]):
        first = clock + k * joints
        columns = tuple(range(first, first + joints))
        yield kind, _part(silent, own, f"{name}: {first}…", layout="csv", columns=columns)


def _incomplete(kind: str, part: dict, joints: int) -> Finding:
    first, *others = part["where"]["columns"]
    count = f"{len(others) + 1} columns ({first} … {others[-1]})" if others else "one column"
    return Finding(
        "incomplete_signal",
        WARNING,
        f"{part['title']} reads like {kind}, but has {count} for {joints} joints, so it was not "
        "taken; log every joint, or describe it in a recipe",
    )


def _part(what: Meaning, file: str, title: str, **where: object) -> dict:
    return {
        "title": title,
        "measured": what.is_measured and meaning(file.rsplit(".", 1)[0]).is_measured,
        "unit": what.unit,
        "where": {"file": file, **where},
    }


def _recipe(
    place: Path, found: Group, joints: int, rate_hz: float | None
) -> tuple[Recipe, list[Finding]]:
    wide: Callable[[dict], bool] = lambda p: len(p["where"].get("columns", ())) in {0, joints}  # noqa: E731
    findings: list[Finding] = []
    for kind, parts in found.items():
        if kind != "time":
            found[kind] = [part for part in parts if wide(part)]
            if not found[kind]:
                findings += [_incomplete(kind, part, joints) for part in parts[:1]]
    if not found.get("position"):
        raise RecordingError(
            f"expected columns, arrays or files of {joints} joint positions in {place.name}, named "
            "like q1 …, position or angle, but found none; describe the files in a recipe"
        )
    chosen: dict[str, Signal] = {}
    run = ""
    for kind, parts in found.items():
        if kind == "time" or not parts:
            continue
        if kind == "acceleration":
            findings.append(_computed(parts))
            continue
        where, many = _run_of(parts)
        run = run or many
        unit = parts[0]["unit"]
        known = {"unit": "A", "gain": 1.0} if unit in {"A", "mA"} else {"unit": unit or SI[kind]}
        chosen[kind] = Signal(**known, **where)
        findings += _left_aside(kind, parts, many)
    time = _UNTOLD
    if found.get("time"):
        where, _ = _run_of(found["time"])
        time = Time(unit=found["time"][0]["unit"] or "s", from_zero=True, **where)
    elif rate_hz is not None:
        time = Time(rate_hz=rate_hz)
    elif "velocity" not in chosen:
        findings.append(
            Finding(
                "missing_clock",
                ERROR,
                "the log has no column of time and no velocity that would tell its rate; give the "
                "rate of the logger with --log-rate, or write rate_hz under [time] of the recipe",
                trap=2,
            )
        )
    recipe = Recipe(run=run, time=time, **chosen)  # type: ignore[arg-type]
    return recipe, findings


def _run_of(parts: list[dict]) -> tuple[dict, str]:
    """Where the first part lies; files that differ in a number are runs, `{run}` in their name."""
    where = dict(parts[0]["where"])
    family = {re.sub(r"\d+(?=\D*$)", "#", p["where"]["file"]) for p in parts if p["measured"]}
    alike = [p["where"]["file"] for p in parts if p["measured"]]
    match = re.search(r"\d+(?=\D*$)", str(where["file"]))
    if len(family) == 1 and len(set(alike)) > 1 and match:
        where["file"] = where["file"][: match.start()] + "{run}" + where["file"][match.end() :]
        return where, match[0]
    return where, ""


def _left_aside(kind: str, parts: list[dict], run: str) -> list[Finding]:
    others = [p["title"] for p in parts[1:] if not (run and p["measured"])]
    others = list(dict.fromkeys(others))
    if not others:
        return []
    told = f"{kind} is read from '{parts[0]['title']}'; left aside: {', '.join(others[:6])}"
    evidence = {"kind": kind, "chosen": parts[0]["title"], "others": others}
    return [Finding("left_aside", INFO, told, evidence, trap=4)]


def _computed(parts: list[dict]) -> Finding:
    told = (
        f"the accelerations '{parts[0]['title']}' are left aside: loggers compute them, with a "
        "filter that nobody knows; they are computed anew, with the filter of the other signals"
    )
    return Finding("left_aside", INFO, told, {"kind": "acceleration"})


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True
