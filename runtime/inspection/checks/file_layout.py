"""A first recipe for files without one: which file, column or array is which signal.

Only names and shapes are used, with SI units unless a title names another; the other checks compare
the numbers. Measured signals are preferred to commanded ones (trap 4). Joints are ordered by their
numbers, whatever the order of the columns (trap 9).
"""

from collections.abc import Callable
from pathlib import Path

from runtime.errors import RecordingError
from runtime.inspection.checks.column_content import Block
from runtime.inspection.checks.column_names import SI
from runtime.inspection.checks.file_runs import run_of, several_runs
from runtime.inspection.checks.signal_parts import Group, has_titles, signal_parts
from runtime.inspection.finding import ERROR, INFO, WARNING, Finding
from runtime.recording import Recipe
from runtime.recording.log_files import LogFiles
from runtime.recording.recipes.recipe import Signal, Time

_NO_CLOCK = Time(rate_hz=1.0)


def draft(
    place: Path, names: tuple[str, ...], rate_hz: float | None = None
) -> tuple[Recipe | None, list[Finding]]:
    """Draft a recipe from names and shapes."""
    if place.is_file() and not has_titles(place):
        return None, []
    plan = _by_convention(place)
    if plan is not None and (plan.torque is not None or plan.law is not None):
        return None, []
    joints = len(names)
    described = signal_parts(place, names)
    if plan is not None and not described.get("torque"):  # no other title names a torque either
        return None, []
    return _recipe(place, described, joints, rate_hz)


def _by_convention(place: Path) -> Recipe | None:
    """The recipe of a file that follows the default convention and has a clock."""
    if not place.is_file():
        return None
    try:
        plan = LogFiles(place, Recipe()).plan()
        timed = plan.time is not None and len(LogFiles(place, plan).table("time", plan.time).values)
    except RecordingError:
        return None
    return plan if timed else None


def _by_content(blocks: tuple[Block, ...]) -> Finding:
    """What every column of a file without header was taken for; `inspect` shows it as a table."""
    rows = [
        {"columns": list(each.columns), "signal": each.kind or None, "reason": each.reason}
        for each in blocks
    ]
    spans = ", ".join(
        f"{each.kind} {each.columns[0]}" + (f"–{each.columns[-1]}" if each.columns[1:] else "")
        for each in blocks
        if each.kind
    )
    return Finding(
        "columns_by_content",
        WARNING,
        f"the file has no header; its columns, counted from 0, were assigned by their content: "
        f"{spans}; check them, then write the recipe with --recipe-out, or correct its columns",
        {"table": rows},
        trap=9,
    )


def _incomplete(kind: str, part: dict, joints: int) -> Finding:
    first, *others = part["where"]["columns"]
    count = f"{len(others) + 1} columns ({first} … {others[-1]})" if others else "one column"
    return Finding(
        "incomplete_signal",
        WARNING,
        f"{part['title']} is named like a {kind} but has {count} for {joints} joints, so it is "
        "not used; log every joint, or describe it in a recipe",
    )


def _recipe(
    place: Path, signals: Group, joints: int, rate_hz: float | None
) -> tuple[Recipe, list[Finding]]:
    wide: Callable[[dict], bool] = lambda p: len(p["where"].get("columns", ())) in {0, joints}  # noqa: E731
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
            findings.append(_computed(parts))
            continue
        where, many = run_of(parts)
        if many and not run:
            findings.append(several_runs(parts, many))
        run = run or many
        unit = parts[0]["unit"]
        known = {"unit": "A", "gain": 1.0} if unit in {"A", "mA"} else {"unit": unit or SI[kind]}
        chosen[kind] = Signal(**known, **where)
        findings += _left_aside(kind, parts, many)
    time = _NO_CLOCK
    if signals.get("time"):
        where, _ = run_of(signals["time"])
        time = Time(unit=signals["time"][0]["unit"] or "s", from_zero=True, **where)
    elif rate_hz is not None:
        time = Time(rate_hz=rate_hz)
    elif "velocity" not in chosen:
        findings.append(
            Finding(
                "missing_clock",
                ERROR,
                "the log has no column of time, and no velocity to compute its rate from; give the "
                "rate of the logger with --log-rate, or write rate_hz under [time] of the recipe",
                trap=2,
            )
        )
    recipe = Recipe(run=run, time=time, **chosen)  # type: ignore[arg-type]
    return recipe, findings


def _left_aside(kind: str, parts: list[dict], run: str) -> list[Finding]:
    others = [p["title"] for p in parts[1:] if not (run and p["measured"])]
    others = list(dict.fromkeys(others))
    if not others:
        return []
    sentence = f"{kind} is read from '{parts[0]['title']}'; not used: {', '.join(others[:6])}"
    evidence = {"kind": kind, "chosen": parts[0]["title"], "others": others}
    return [Finding("left_aside", INFO, sentence, evidence, trap=4)]


def _computed(parts: list[dict]) -> Finding:
    sentence = (
        f"the accelerations '{parts[0]['title']}' are not used: loggers compute them with an "
        "unknown filter; they are computed again with the filter of the other signals"
    )
    return Finding("left_aside", INFO, sentence, {"kind": "acceleration"})
