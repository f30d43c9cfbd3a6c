"""Experiments → `Page`: a group per study, tables and figures in the order of the document.

Every section states the config hash of its numbers and links to their origin. The section of a
Markdown page contains no computing times: equal results give equal text and figures on any machine.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import write_text
from runtime.common.tables import Table
from runtime.errors import RuntimeFault
from runtime.experiments.report import labels
from runtime.experiments.report.drawing import draw, has_figure, inline
from runtime.experiments.report.reading import WANTED, Experiment
from runtime.experiments.study import View
from runtime.outputs.report.canvas import picture
from runtime.outputs.report.page import Page, Section, Tile

BEGIN, END = "<!-- reproduce -->", "<!-- /reproduce -->"
GALLERY = "images"
PICTURES = 3  # number of figures in the section
CHOICE = ("fig-5.8", "fig-5.7", "fig-3.3", "fig-5.2", "fig-5.4", "fig-5.1", "fig-A.2")
"""Candidates, of which the first available ones are shown."""
LARGEST_PICTURE = 60_000  # largest size of a figure [byte]
RUBBING = "-friction"  # end of the names of methods with friction columns
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
    write_text(path, f"{before}{BEGIN}{chr(10).join(body)}{END}{after}")
    return (path, *(file for _, file in pictures))


def _pictures(experiments: tuple[Experiment, ...], folder: Path) -> list[tuple[str, Path]]:
    there = {view.id: (e, view) for e in experiments for view in e.views}
    written = []
    for name in [name for name in CHOICE if name in there][:PICTURES]:
        experiment, view = there[name]
        path = folder / f"{name}.png"
        with picture(path, _SIZE, _DPI) as figure:
            draw(figure, experiment, view)
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
                    head = f"{caption(view)} | {labels.case_name(case)}"
                    lines.append(f"| {head} | {' | '.join(cells)} | `{experiment.short_hash}` |")
    return lines


def _airm(experiment: Experiment, view: View, case: str) -> tuple[str, ...] | None:
    document = experiment.document.get(view.document, {}).get((case, "adam", labels.AIRM))
    ours = experiment.values.get((case, "adam", labels.AIRM))
    if document is None or ours is None:
        return None
    best = experiment.best(case, labels.AIRM)
    shown = (labels.measured(value, labels.AIRM, view.spread) for value in (ours, best))
    return f"AIRM{_over(view)}", labels.printed(document, labels.AIRM), *shown


def _over(view: View) -> str:
    """Statistic of a table of quartiles, for its caption."""
    return ", median [quartiles] of 20 designs" if view.spread == "quartiles" else ""


def _torque(experiment: Experiment, view: View, case: str) -> tuple[str, ...] | None:
    """Cells of the torque error averaged over trials and joints."""
    document = experiment.document.get(view.document, {})
    names = [m for m in view.metrics if (case, "adam", m) in document]
    names = [m for m in names if m.startswith("tau_error_")]
    best = experiment.best_method
    if not names or any((case, "adam", m) not in experiment.values for m in names):
        return None
    head = "torque error, mean of joints %"
    published = f"{sum(document[case, 'adam', m].mean for m in names) / len(names):.2g}"
    if view.spread == "quartiles":
        quartiles = np.mean([experiment.values[case, "adam", m].quartiles for m in names], axis=0)
        low, middle, high = (f"{x:.2g}" for x in quartiles)
        return f"{head}{_over(view)}", published, f"{middle} [{low} to {high}]", labels.NOTHING
    cells = [_mean(experiment, case, method, names) for method in ("adam", best)]
    if best.endswith(RUBBING):  # the others with the same friction columns stand beside it
        rest = [m for m in experiment.methods if m.endswith(RUBBING) and m != best]
        means = (f"{labels.method_name(m)} {_mean(experiment, case, m, names)}" for m in rest)
        others = ", ".join(means)
        cells[1] = f"{cells[1]} with friction columns ({others}; without: MAP " + (
            f"{_mean(experiment, case, 'map', names)})"
        )
    return head, published, *cells


def _mean(experiment: Experiment, case: str, method: str, names: list[str]) -> str:
    """Mean of several metrics of a method."""
    known = [experiment.values.get((case, method, m)) for m in names]
    means = [value.mean for value in known if value is not None]
    return f"{sum(means) / len(means):.2g}" if means else labels.NOTHING


DOCUMENT_TRIALS = 150  # number of Monte Carlo trials of the document
GLOSSARY = (
    ("document", "number printed in the source document"),
    ("λ-Adam", "method and settings of the document, on the data of this package"),
    ("MAP", "method of this package: most probable consistent model, initial guess as prior"),
    ("AIRM", "affine-invariant distance of true and identified mass matrix, 0 if equal"),
    ("a ± b", "mean and standard deviation over the trials"),
    ("torque error", "100 ‖true − predicted‖ / ‖true‖ per joint on a test motion, Eq. 5.1"),
    (
        "config hash",
        "SHA-256 of config, seed and robot; equal hashes give equal digits, except times",
    ),
)


def experiments_page(experiments: tuple[Experiment, ...], notes: tuple[str, ...]) -> Page:
    """Page of all finished studies."""
    shown = [section for experiment in experiments for section in _sections(experiment)]
    return Page(
        title="Experiments of the document, reproduced",
        subtitle="tables and figures beside the published numbers",
        headline=headline(experiments),
        notes=notes,
        warnings=tuple(_warnings(experiments)),
        tiles=_tiles(experiments),
        sections=(*shown, *map(_origin, experiments)),
        glossary=GLOSSARY,
    )


def headline(experiments: tuple[Experiment, ...]) -> str:
    """Comparison of the final AIRM with the document in one sentence."""
    pairs = list(_airms(experiments))
    if not pairs:
        return "Experiments of the document, with the origin of every number."
    ratios = [max(ours / document, document / ours) for document, ours, _ in pairs]
    near = f"The final AIRM of the document is reproduced within a factor of {max(ratios):.2g}"
    best = [(ours, other) for _, ours, other in pairs if other is not None]
    won = sum(other < ours for ours, other in best)
    return f"{near}; MAP is closer to the truth on the same data in {won} of {len(best)} cases."


def _airms(experiments: tuple[Experiment, ...]) -> Iterator[tuple[float, float, float | None]]:
    """Yield per case the mean AIRM of the document, of its method here, and of MAP or LM."""
    for experiment in experiments:
        for document in experiment.document.values():
            for (case, method, metric), value in document.items():
                ours = experiment.values.get((case, method, metric))
                if metric == labels.AIRM and ours is not None:
                    best = experiment.best(case, labels.AIRM)
                    yield value.mean, ours.mean, None if best is None else best.mean


def _warnings(experiments: tuple[Experiment, ...]) -> Iterator[str]:
    few = [e for e in experiments if e.trials < DOCUMENT_TRIALS and _is_monte_carlo(e)]
    if few:
        yield (
            f"fewer trials than the {DOCUMENT_TRIALS} of the document, so that means are less "
            f"certain: {', '.join(f'{e.name} ({e.trials})' for e in few)}"
        )
    there = {view.id for experiment in experiments for view in experiment.views}
    missing = [name for name in WANTED if name not in there]
    if missing:
        yield (
            f"not in this folder: {', '.join(missing)}; to compute them, run: "
            "python -m runtime reproduce all"
        )


def _is_monte_carlo(experiment: Experiment) -> bool:
    numbers = (value for known in experiment.document.values() for value in known.values())
    return any(value.std is not None for value in numbers)


def _tiles(experiments: tuple[Experiment, ...]) -> tuple[Tile, ...]:
    views = [view for experiment in experiments for view in experiment.views]
    figures = sum(map(has_figure, views))
    trials = sum(e.trials * len(e.cases) for e in experiments if _is_monte_carlo(e))
    consistent = []
    for e in experiments:
        for (_, method, metric), value in e.values.items():
            if metric == "consistent" and method in {"adam", e.best_method}:
                consistent.append(value.mean)
    share = f"{100 * min(consistent):.4g}\N{NO-BREAK SPACE}%" if consistent else "–"
    tone = "plain" if not consistent else "good" if min(consistent) == 1 else "bad"
    return (
        Tile("Studies", str(len(experiments)), "each with config, seed and hash"),
        Tile("Tables and figures", f"{len(views) - figures} + {figures}", "of the document"),
        Tile("Trials", str(trials), "Monte Carlo, all cases"),
        Tile("Consistent results", share, "λ-Adam and MAP or LM, worst case", tone),
    )


def _sections(experiment: Experiment) -> Iterator[Section]:
    source = f"from {experiment.name}, config {experiment.short_hash}"
    for view in experiment.views:
        document = experiment.source.get(view.document, "")
        lead = f"{view.title}. {_cases(experiment, view)}".strip()
        shown = list(labels.tables(experiment, view))
        figure = inline(experiment, view) if has_figure(view) else ""
        title = caption(view)
        note = f" · document: {document}" if document and document not in title else ""
        sources = ((f"study-{experiment.name}", f"{source}{note}"),)
        known: dict[str, Any] = {"group": experiment.title, "sources": sources}
        first, *further = shown or (None,)
        yield Section(title, lead, first, figure, **known)
        for table in further:
            yield Section(f"{title}, continued", "", table, **known)


def caption(view: View) -> str:
    """Caption of a view: `table-5.2` → Table 5.2, `table-5.2-designs` → Table 5.2 over designs."""
    match = re.fullmatch(r"(table|fig)-(.+)", view.id)
    if match is None:
        return view.title if not view.id.startswith("tables-") else f"Tables {view.id[7:]}"
    number, _, variant = match[2].partition("-")
    kind = {"table": "Table", "fig": "Figure"}[match[1]]
    return f"{kind} {number} over {variant}" if variant else f"{kind} {number}"


def _cases(experiment: Experiment, view: View) -> str:
    if not view.metrics:
        return ""
    sentences = [
        f"{labels.case_name(c)}: {experiment.cases[c]}" for c in view.cases if c in experiment.cases
    ]
    plain = [text for text in sentences if len(set(text.split(": "))) > 1]
    return f"{'; '.join(plain)}." if plain else ""


def _origin(experiment: Experiment) -> Section:
    facts = [(key.replace("_", " "), _text(value)) for key, value in experiment.facts.items()]
    methods = [(f"method {name}", text) for name, text in experiment.methods.items()]
    rows = (*experiment.provenance, *methods, *facts)
    return Section(
        f"Data of {experiment.name}",
        table=Table(
            ("quantity", "value"),
            rows,
            kind="facts",
            row_anchors=(f"study-{experiment.name}", *("",) * (len(rows) - 1)),
        ),
        group="Origin of the numbers",
    )


def _text(value: object) -> str:
    if isinstance(value, str):
        return value
    rounded = json.loads(json.dumps(value), parse_float=lambda text: float(f"{float(text):.4g}"))
    return json.dumps(rounded, ensure_ascii=False).replace('"', "")
