"""All rows of a study → trials.parquet, series.npz and, last, result.json with their SHA-256."""

import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import json_of, replacing, sha256_of
from runtime.experiments.storage.chunks import write_rows
from runtime.experiments.study import FORMAT, Row, Study, StudyOutcome
from runtime.identification.result_file import versions
from runtime.library import Array, Library

_FILE = Path(__file__).with_name("document_numbers.toml")


def document_values(ids: Iterable[str]) -> list[dict[str, Any]]:
    """Entries {id, source, case, method, metric, mean, std} of the ids that have numbers.

    A corrected number has a further `misprint`, the text that the document prints.

    A metric with a list of pairs is one per joint: `tau_error` gives tau_error_1, tau_error_2, …
    """
    tables = tomllib.loads(_FILE.read_text(encoding="utf-8"))
    lines = []
    for name in dict.fromkeys(ids):
        table = tables.get(name, {})
        for entry in table.get("entries", ()):
            kept = {key: entry[key] for key in ("case", "method")}
            for metric, value in entry.items():
                if metric in kept or metric == "misprints":
                    continue
                for label, mean, std in _pairs(metric, value):
                    line = {"metric": label, "mean": mean, "std": std}
                    misprint = entry.get("misprints", {}).get(label)
                    line |= {} if misprint is None else {"misprint": misprint}
                    lines.append({"id": name, "source": table["source"], **kept, **line})
    return lines


def _pairs(metric: str, value: Any) -> list[tuple[str, float, float | None]]:
    """A number, [mean, std], or one of those per joint."""
    if not isinstance(value, list):
        return [(metric, float(value), None)]
    if value and isinstance(value[0], list):
        return [
            (f"{metric}_{joint}", float(pair[0]), float(pair[1]) if len(pair) > 1 else None)
            for joint, pair in enumerate(value, start=1)
        ]
    return [(metric, float(value[0]), float(value[1]))]


RESULT, TRIALS, SERIES, CONFIG = "result.json", "trials.parquet", "series.npz", "config.json"
QUARTILES = (0.25, 0.5, 0.75)
_NO_FIGURE = ("case", "method", "trial", "status", "curve")


def write_outcome(
    study: Study,
    folder: Path,
    lib: Library,
    config: Mapping[str, Any],
    mark: str,
    trials: int,
    rows: Sequence[Row],
    finished: StudyOutcome,
    command: str,
) -> dict[str, Any]:
    """Write trials.parquet, series.npz and result.json."""
    both = [*rows, *finished.rows]
    flat = [{k: v for k, v in row.items() if k != "curve"} for row in both]
    write_rows(flat, folder / TRIALS, mark)
    with replacing(folder / SERIES) as file:
        np.savez_compressed(file, **finished.series)  # type: ignore[arg-type]
    facts = {
        "format": FORMAT,
        "study": study.name,
        "title": study.title,
        "config": dict(config),
        "config_hash": mark,
        "trials": trials,
        "robot": lib.name,
        "joints": list(lib.joint_names),
        "model_hash": lib.manifest.model_hash,
        "versions": versions() | lib.manifest.versions,
        "command": command,
        "files": {name: sha256_of(folder / name) for name in (TRIALS, SERIES)},
        "cases": dict(study.cases),
        "methods": dict(study.methods),
        "views": [asdict(view) for view in study.views],
        "facts": finished.facts,
        "summary": summary(flat),
        "document": document_values([v.document or v.id for v in study.views]),
    }
    write_json(folder / RESULT, facts)
    return facts


def summary(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Mean, standard deviation (n − 1) and count of every metric, case and method."""
    values: dict[tuple[str, str, str], list[float]] = {}
    for row in rows:
        for name, value in row.items():
            if name not in _NO_FIGURE:
                values.setdefault((row["case"], row["method"], name), []).append(float(value))
    return [
        {
            "case": case,
            "method": method,
            "metric": metric,
            "mean": float(np.mean(numbers)),
            "std": float(np.std(numbers, ddof=1)) if len(numbers) > 1 else None,
            "n": len(numbers),
            "quartiles": np.quantile(numbers, QUARTILES).tolist(),
        }
        for (case, method, metric), numbers in values.items()
    ]


def valid_result(folder: Path, mark: str | None = None) -> dict[str, Any] | None:
    """Content of result.json where it matches its files.

    Args:
        folder: of a study.
        mark: expected config hash; None for any.

    Returns:
        The content; None where a file is missing, damaged or of another hash.
    """
    try:
        facts = json_of(folder / RESULT)
        whole = all(sha256_of(folder / name) == digest for name, digest in facts["files"].items())
        right = facts["format"] == FORMAT and mark in {None, facts["config_hash"]}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return dict(facts) if whole and right else None


def read_series(folder: Path) -> dict[str, Array]:
    """Series of a study, after `valid_result` has checked them."""
    with np.load(folder / SERIES) as file:
        return {name: file[name] for name in file.files}


def write_json(path: Path, facts: Mapping[str, Any]) -> None:
    """Write indented JSON without NaN, complete or not at all."""
    text = json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with replacing(path) as file:
        file.write(text.encode())
