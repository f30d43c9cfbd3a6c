"""Numbers of the document, from document_numbers.toml, each with its table in the document."""

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

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
