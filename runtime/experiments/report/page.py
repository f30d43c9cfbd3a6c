"""Experiments → `Page`: a group per study, tables and figures in the order of the document.

Every section states the config hash of its numbers and links to their origin.
"""

import json
import re
from collections.abc import Iterator

from runtime.common.tables import Table
from runtime.experiments.report.drawing import has_figure, inline
from runtime.experiments.report.labels import AIRM, best_method, case_name, short_hash
from runtime.experiments.report.reading import WANTED, Experiment
from runtime.experiments.report.tables import tables
from runtime.experiments.study import View
from runtime.outputs.report.page import Page, Section, Tile

DOCUMENT_TRIALS = 150
"""Number of Monte Carlo trials of the document."""
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
        status="",
        warnings=(*notes, *_warnings(experiments)),
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
                if metric == AIRM and ours is not None:
                    best = experiment.values.get((case, best_method(experiment), AIRM))
                    yield value.mean, ours.mean, None if best is None else best.mean


def _warnings(experiments: tuple[Experiment, ...]) -> Iterator[str]:
    few = [
        f"{e.name} ({e.trials})"
        for e in experiments
        if e.trials < DOCUMENT_TRIALS and _is_monte_carlo(e)
    ]
    if few:
        yield (
            f"fewer trials than the {DOCUMENT_TRIALS} of the document, so that means are less "
            f"certain: {', '.join(few)}"
        )
    there = {view.id for experiment in experiments for view in experiment.views}
    missing = [name for name in WANTED if name not in there]
    if missing:
        yield (
            f"not in this folder: {', '.join(missing)}; to compute them, run: "
            "python -m runtime reproduce all"
        )


def _is_monte_carlo(experiment: Experiment) -> bool:
    return any(
        v.std is not None for document in experiment.document.values() for v in document.values()
    )


def _tiles(experiments: tuple[Experiment, ...]) -> tuple[Tile, ...]:
    views = [view for experiment in experiments for view in experiment.views]
    figures = sum(map(has_figure, views))
    trials = sum(e.trials * len(e.cases) for e in experiments if _is_monte_carlo(e))
    consistent = [
        value.mean
        for e in experiments
        for (_, method, metric), value in e.values.items()
        if metric == "consistent" and method in {"adam", best_method(e)}
    ]
    share = f"{100 * min(consistent):.4g}\N{NO-BREAK SPACE}%" if consistent else "–"
    tone = "plain" if not consistent else "good" if min(consistent) == 1 else "bad"
    return (
        Tile("Studies", str(len(experiments)), "each with config, seed and hash"),
        Tile("Tables and figures", f"{len(views) - figures} + {figures}", "of the document"),
        Tile("Trials", str(trials), "Monte Carlo, all cases"),
        Tile("Consistent results", share, "λ-Adam and MAP or LM, worst case", tone),
    )


def _sections(experiment: Experiment) -> Iterator[Section]:
    source = (
        f"study-{experiment.name}",
        f"from {experiment.name}, config {short_hash(experiment)}",
    )
    for view in experiment.views:
        document = experiment.source.get(view.document, "")
        lead = f"{view.title}. {_cases(experiment, view)}".strip()
        shown = list(tables(experiment, view))
        figure = inline(experiment, view) if has_figure(view) else ""
        title = caption(view)
        note = f" · document: {document}" if document and document not in title else ""
        link = ((source[0], f"{source[1]}{note}"),)
        for number, table in enumerate(shown or [None]):
            yield Section(
                title if not number else f"{title}, continued",
                "" if number else lead,
                table,
                figure if not number else "",
                group=experiment.title,
                sources=link,
            )


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
        f"{case_name(c)}: {experiment.cases[c]}" for c in view.cases if c in experiment.cases
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
