"""Runs of a folder: files whose names differ in their last number only, such as `log_1.csv`."""

import re
from typing import Any

from runtime.inspection.finding import INFO, Finding

_NUMBER = re.compile(r"\d+(?=\D*$)")


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
    """Which of the runs of a folder is read, and how to read the others."""
    files = [str(part["where"]["file"]) for part in parts if part["measured"]]
    names = sorted({_NUMBER.findall(name)[0] for name in files}, key=int)
    sentence = (
        f"the folder contains the runs {', '.join(names)}; without --run, run {run} is "
        f"inspected; identify from all of them with --run {','.join(names)}"
    )
    return Finding("several_runs", INFO, sentence, {"runs": names, "inspected": run})
