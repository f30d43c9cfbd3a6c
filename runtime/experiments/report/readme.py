"""The result section of a Markdown page with its table and figures, from the experiments.

It contains no computing times: equal results give equal text and figures on any machine.
"""

from pathlib import Path

import numpy as np

from runtime.common.files import replacing
from runtime.errors import RuntimeFault
from runtime.experiments.report.drawing import write_picture
from runtime.experiments.report.labels import (
    AIRM,
    NOTHING,
    best_method,
    case_name,
    measured,
    method_name,
    printed,
    short_hash,
)
from runtime.experiments.report.page import caption
from runtime.experiments.report.reading import Experiment
from runtime.experiments.study import View

BEGIN, END = "<!-- reproduce -->", "<!-- /reproduce -->"
GALLERY = "images"
PICTURES = 3
"""Number of figures in the section."""
CHOICE = ("fig-5.8", "fig-5.7", "fig-3.3", "fig-5.2", "fig-5.4", "fig-5.1", "fig-A.2")
"""Candidates, of which the first available ones are shown."""
LARGEST_PICTURE = 60_000
"""Largest size of a figure [byte]."""
RUBBING = "-friction"
"""End of the names of methods with friction columns."""
_SIZE, _DPI = (5.6, 3.4), 90


def write_readme(experiments: tuple[Experiment, ...], path: Path, command: str) -> tuple[Path, ...]:
    """Replace the section between the markers; figures go into the folder `images` beside it."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise RuntimeFault(
            f"cannot read '{path}' ({error.strerror}); name a Markdown file"
        ) from None
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise RuntimeFault(
            f"expected the markers {BEGIN} and {END} in '{path}', got none; add them"
        )
    pictures = _pictures(experiments, path.parent / GALLERY)
    gallery = [f"![{title}]({GALLERY}/{file.name})" for title, file in pictures]
    body = ["", f"`{command}` wrote this section.", "", *_table(experiments)]
    body += ["", " ".join(gallery), ""] if gallery else [""]
    with replacing(path) as file:
        file.write(f"{before}{BEGIN}{chr(10).join(body)}{END}{after}".encode())
    return (path, *(file for _, file in pictures))


def _pictures(experiments: tuple[Experiment, ...], folder: Path) -> list[tuple[str, Path]]:
    there = {view.id: (e, view) for e in experiments for view in e.views}
    written = []
    for name in [name for name in CHOICE if name in there][:PICTURES]:
        experiment, view = there[name]
        path = folder / f"{name}.png"
        write_picture(experiment, view, path, _SIZE, _DPI)
        if path.stat().st_size > LARGEST_PICTURE:
            raise RuntimeFault(
                f"expected at most {LARGEST_PICTURE} bytes in '{path}', got {path.stat().st_size}; "
                "reduce its size in readme.py"
            )
        written.append((f"{caption(view)}: {view.title}", path))
    return written


def _table(experiments: tuple[Experiment, ...]) -> list[str]:
    lines = [
        "| document | case | figure | document's | λ-Adam as there | ours | config |",
        "|---|---|---|---|---|---|---|",
    ]
    shown: set[tuple[str, str, str]] = set()
    for experiment in experiments:
        for view in (v for v in experiment.views if v.kind == "table"):
            for case in view.cases:
                cells = _airm(experiment, view, case) or _torque(experiment, view, case)
                if cells and (experiment.name, case, cells[0]) not in shown:
                    shown.add((experiment.name, case, cells[0]))
                    head = f"{caption(view)} | {case_name(case)}"
                    lines.append(f"| {head} | {' | '.join(cells)} | `{short_hash(experiment)}` |")
    return lines


def _airm(experiment: Experiment, view: View, case: str) -> tuple[str, ...] | None:
    document = experiment.document.get(view.document, {}).get((case, "adam", AIRM))
    ours = experiment.values.get((case, "adam", AIRM))
    if document is None or ours is None:
        return None
    best = experiment.values.get((case, best_method(experiment), AIRM))
    shown = (measured(value, AIRM, view.spread) for value in (ours, best))
    return f"AIRM{_over(view)}", printed(document, AIRM), *shown


def _over(view: View) -> str:
    """Statistic of a table of quartiles, for its caption."""
    return ", median [quartiles] of 20 designs" if view.spread == "quartiles" else ""


def _torque(experiment: Experiment, view: View, case: str) -> tuple[str, ...] | None:
    """Cells of the torque error averaged over trials and joints."""
    document = experiment.document.get(view.document, {})
    names = [m for m in view.metrics if (case, "adam", m) in document]
    names = [m for m in names if m.startswith("tau_error_")]
    best = best_method(experiment)
    if not names or any((case, "adam", m) not in experiment.values for m in names):
        return None
    head = "torque error, mean of joints %"
    published = f"{sum(document[case, 'adam', m].mean for m in names) / len(names):.2g}"
    if view.spread == "quartiles":
        quartiles = np.mean([experiment.values[case, "adam", m].quartiles for m in names], axis=0)
        low, middle, high = (f"{x:.2g}" for x in quartiles)
        return f"{head}{_over(view)}", published, f"{middle} [{low} to {high}]", NOTHING
    cells = [_mean(experiment, case, method, names) for method in ("adam", best)]
    if best.endswith(RUBBING):  # the others with the same friction columns stand beside it
        others = ", ".join(
            f"{method_name(m)} {_mean(experiment, case, m, names)}"
            for m in experiment.methods
            if m.endswith(RUBBING) and m != best
        )
        cells[1] = f"{cells[1]} with friction columns ({others}; without: MAP " + (
            f"{_mean(experiment, case, 'map', names)})"
        )
    return head, published, *cells


def _mean(experiment: Experiment, case: str, method: str, names: list[str]) -> str:
    """Mean of several metrics of a method."""
    known = [experiment.values.get((case, method, m)) for m in names]
    means = [value.mean for value in known if value is not None]
    return f"{sum(means) / len(means):.2g}" if means else NOTHING
