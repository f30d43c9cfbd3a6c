"""`symgen watch`."""

import hashlib
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import typer

from runtime.cli.log_options import Recipe, ResultChoices, Run, bundled_logs, open_result, runs_of
from runtime.common.files import bytes_of, json_text
from runtime.common.settings import argument_field, data_field, output_field
from runtime.common.tables import Table
from runtime.common.terminal import say, say_notes, show
from runtime.common.texts import number_of
from runtime.errors import RecordingError
from runtime.identification.saved_result import SavedResult
from runtime.library import Library
from runtime.monitoring import drift, watch
from runtime.monitoring.trends import append_history, read_history
from runtime.recording import Recording
from runtime.recording.reader import locate, mean_of_column, read_further

SHOWN = 5
_CHANGE = ("group", "where", "size", "interval", "unit")
_TEST = ("group", "where", "size", "unit", "p_value", "freedom", "score", "least")


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchSettings(ResultChoices):
    """Settings of `symgen watch`."""

    options = "robot recipe history references as_json"
    logs: list[str] = argument_field(
        metavar="LOG…", autocompletion=bundled_logs, help="Later logs of the robot."
    )
    recipe: Recipe = None
    run: Run = None
    history: Path | None = data_field(
        metavar="FILE", help="Append the verdicts to a history, one JSON object per line."
    )
    temperature: str | None = data_field(
        metavar="COLUMN|NUMBER",
        help="Temperature for the history: a column of the logs, or a number for all [°C].",
    )
    date: str | None = data_field(
        metavar="DATE", help="Date of the logs, 2026-11-30; default that of their files."
    )
    references: list[str] | None = data_field(
        None,
        "--reference",
        metavar="LOG",
        help="Log of another day of the healthy robot, from which the usual change between "
        "days is learnt; three or more, once each. [default: an assumed one]",
    )
    as_json: bool = output_field(False, "--json", help="Print JSON instead.")


def watch_command(given: WatchSettings) -> None:
    r"""Test whether a robot has changed since its model was identified.

    \b
    symgen watch results/fr3_simulated-map fr3_simulated
    symgen watch results/arm monday.csv
    symgen watch results/arm monday.csv tuesday.csv --history results/arm/history.jsonl
    symgen watch results/arm friday.csv --reference mon.csv --reference tue.csv --reference wed.csv
    symgen watch results/arm monday.csv --history h.jsonl --settings temperature=motor_temp
    symgen report h.jsonl

    Tested are gain, bias and drift of every torque sensor, friction and its warming, every link, a
    body on the tip, all links together, and a delay of the torque. What the model leaves on the
    rows that it was tested on, its uncertainty, and the usual change of a healthy robot between two
    days are no change; p-values are corrected for the number of tests.

    The exit code is 1 where a log shows a change (p below 0.01), else 0.
    """
    saved, lib, notes = open_result(given, given.result, free_base=True)
    if given.history is not None:
        read_history(given.history)  # before any work
    runs = runs_of(given.logs, given.run)
    circumstances = []
    for place, run in runs:
        degrees = _temperature(place, given.recipe, run, given.temperature)
        circumstances.append({"recorded": _recorded(place, given.date), "temperature": degrees})
    later = [log if run is None else _of_run(saved, lib, given, log, run) for log, run in runs]
    known = saved, lib, later, given.references or (), given.recipe
    verdicts, joints = watch.watched(given.result, *known)
    entries = [_facts(verdict) for verdict in verdicts]
    if given.history is not None:
        file = given.result / "result.json" if given.result.is_dir() else given.result
        check = {  # when and with which model a check was made
            "checked": datetime.now(UTC).isoformat(timespec="seconds"),
            "result_sha256": hashlib.sha256(bytes_of(file)).hexdigest(),
            "model_hash": lib.manifest.model_hash,
        }
        rows = []
        for log, each, facts, verdict in zip(joints, circumstances, entries, verdicts, strict=True):
            marks = {"log_sha256": dict(log.source), "sizes": _sizes(verdict)}
            rows.append(check | each | facts | marks)
        append_history(given.history, rows)
    worst = min(range(len(entries)), key=lambda k: entries[k]["p_value"])
    if given.as_json:
        many = {"logs": entries} if len(entries) > 1 else {}
        facts = entries[worst] | many | {"notes": list(notes)}
        print(json_text(facts), end="")
    else:
        for verdict in verdicts:
            _show(verdict)
        say_notes(notes)
    if any(verdict.changed for verdict in verdicts):
        raise typer.Exit(1)


def _of_run(
    saved: SavedResult, lib: Library, given: WatchSettings, log: str, run: str
) -> Recording:
    """A run of a log, named by both."""
    if saved.record.is_free:
        raise RecordingError("the setting run does not apply to a log of a free base; leave it out")
    read = read_further(log, given.recipe, run, lib.joint_names, saved.recipe)
    return read.replace(name=f"{Path(log).stem} run {run}")


def _facts(verdict: drift.Verdict) -> dict[str, Any]:
    best = _picked(verdict.best, *_CHANGE) if verdict.changed else dict.fromkeys(_CHANGE)
    return {
        "log": verdict.log,
        "changed": verdict.changed,
        **best,
        "p_value": verdict.p_value,
        "alpha": drift.ALPHA,
        "n_eff": verdict.n_eff,
        "torque_error_percent": verdict.error,
        "sentence": verdict.sentence(),
        "tests": [_picked(test, *_TEST) for test in verdict.tests[:SHOWN]],
        "beside": [_picked(test, *_TEST) for test in verdict.beside[:SHOWN]],
        "references": verdict.references,
        "hidden": verdict.hidden(),
    }


def _picked(test: drift.Change, *names: str) -> dict[str, Any]:
    return {name: getattr(test, name) for name in names}


def _sizes(verdict: drift.Verdict) -> list[dict[str, Any]]:
    """Estimated size of every change that has one, for trends."""
    sized = (each for each in verdict.tests if each.size is not None and each.interval is not None)
    return [_picked(each, *_CHANGE) for each in sized]


def _recorded(log: str, date: str | None) -> str:
    """Date of a log: as given, else that of its file."""
    if date is None:
        when = datetime.fromtimestamp(locate(log).stat().st_mtime, UTC)
        return when.isoformat(timespec="seconds")
    try:
        return datetime.fromisoformat(date).isoformat(timespec="seconds")
    except ValueError:
        raise RecordingError(
            "expected a date such as 2026-11-30 or 2026-11-30T08:15 for --settings date=DATE, got "
            f"'{date}'; correct it"
        ) from None


def _temperature(log: str, recipe: str | None, run: str | None, given: str | None) -> float | None:
    """Temperature of a log [°C]: a number, or the mean of one of its columns."""
    if given is None:
        return None
    if (number := number_of(given)) is None:
        return mean_of_column(log, recipe, run, given)
    if not -273.15 <= number < 1e4:
        raise RecordingError(
            f"expected a temperature in °C or a column for --settings "
            f"temperature=COLUMN|NUMBER, got {given}; correct it"
        )
    return number


def _show(verdict: drift.Verdict) -> None:
    say(verdict.sentence())
    title = "the change, and what it leaves" if verdict.changed else "closest to a change"
    rows = []
    for test in (verdict.best, *verdict.beside[: SHOWN - 1]):
        size = "" if test.size is None else f"{test.size:+.3g}"
        row = (test.group, test.where or "robot", size, test.unit)
        rows.append((*row, f"{test.p_value:.1e}", f"{test.score:.1f}"))
    head = ("part", "where", "size", "unit", "p, single test", "score")
    show(Table(head, tuple(rows), title=title))
    say(verdict.hidden())
