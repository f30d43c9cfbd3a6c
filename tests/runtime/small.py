"""The experiments with motions of 4 s and few methods: the same code in a tenth of the time.

As a script it runs one study, for tests that kill it; its arguments are the robot's folder, the
folder of the results, the study, how many trials and how many per chunk.
"""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from runtime import load
from runtime.experiments import IDS, STUDIES, Request, reproduce
from runtime.experiments.storage import read_rows
from runtime.experiments.study import Row

CONFIGS: dict[str, dict[str, Any]] = {
    "excitation": {"starts": 3, "harmonics": 3, "duration": 4.0},
    "designs": {"starts": 3, "harmonics": 3, "duration": 4.0, "trials": 2},
    "logs": {"repeats": 0},
    "methods": {"methods": ("map", "ols", "iv")},
}
TRIALS = {"excitation": 3, "designs": 2, "logs": 6, "methods": 3}


@contextmanager
def small(per_chunk: int | None = None) -> Iterator[None]:
    """The registry holds small studies while the block runs."""
    before = dict(STUDIES), dict(IDS)
    for name, study in before[0].items():
        changes: dict[str, Any] = {"trials": TRIALS.get(name, study.trials)}
        if per_chunk is not None:
            changes["per_chunk"] = per_chunk
        config = replace(study.config, **CONFIGS.get(name, {}))
        STUDIES[name] = replace(study, config=config, **changes)
    IDS.update(
        {view.id: STUDIES[study.name] for study in before[1].values() for view in study.views}
    )
    try:
        yield
    finally:
        for registry, old in zip((STUDIES, IDS), before, strict=True):
            registry.clear()
            registry.update(old)  # type: ignore[arg-type]


def rows_of(out: Path, study: str) -> list[Row]:
    """All rows of a finished study, without the seconds."""
    mark = json.loads((out / study / "config.json").read_text())["config_hash"]
    rows = read_rows(out / study / "trials.parquet", mark)
    assert rows is not None
    return [{k: v for k, v in row.items() if k != "time_s"} for row in rows]


if __name__ == "__main__":
    folder, out, wanted, trials, size = sys.argv[1:]
    with small(int(size)):
        request = Request(Path(out), int(trials), threads=1)
        reproduce(load(Path(folder)), STUDIES[wanted], request)
