"""Experiments → `Page`: a group per study, tables and figures in the document's order.

Every section names the config hash that its numbers have, and leads to where it came from.
"""

import json
import re
from collections.abc import Iterator

from runtime.outputs.report.experiments.drawing import has_figure, inline
from runtime.outputs.report.experiments.labels import AIRM, best_method, case_name, short_hash
from runtime.outputs.report.experiments.reading import WANTED, Experiment, SavedView
from runtime.outputs.report.experiments.tables import tables
from runtime.outputs.report.layout import Page, ReportTable, Section, Tile

DOCUMENT_TRIALS = 150
GLOSSARY = (
    ("document", "the number that the source document prints"),
    ("λ-Adam", "the document's method with the document's settings, on our data"),
    ("MAP", "our best method: the most probable consistent model, the first guess as prior"),
    ("AIRM", "affine-invariant distance of true and identified mass matrix, 0 where equal"),
    ("a ± b", "mean and standard deviation over the trials"),
    ("torque error", "100 ‖true − predicted‖ / ‖true‖ per joint on a test motion, Eq. 5.1"),
    ("config hash", "SHA-256 of config, seed and robot: same hash, same digits (time excepted)"),
)


def experiments_page(experiments: tuple[Experiment, ...], notes: tuple[str, ...]) -> Page:
    """The whole report."""
    shown = [section for experiment in experiments for section in _sections(experiment)]
    return Page(
        title="Experiments beside the document's",
        subtitle="the document's tables and figures, reproduced",
        headline=headline(experiments),
        status="",
        warnings=(*notes, *_warnings(experiments)),
        tiles=_tiles(experiments),
        sections=(*shown, *map(_origin, experiments)),
        glossary=GLOSSARY,
    )


def headline(experiments: tuple[Experiment, ...]) -> str:
    """What the distances say, in a sentence; counted, not claimed."""
    pairs = list(_airms(experiments))
    if not pairs:
        return "The document's experiments, with where every number comes from."
    ratios = [max(ours / document, document / ours) for document, ours, _ in pairs]
    near = f"The document's final AIRM is met within a factor {max(ratios):.2g} in every case"
    best = [(ours, other) for _, ours, other in pairs if other is not None]
    won = sum(other < ours for ours, other in best)
    return f"{near}; our method on the same data is nearer to the truth in {won} of {len(best)}."


def _airms(experiments: tuple[Experiment, ...]) -> Iterator[tuple[float, float, float | None]]:
    """The document's mean AIRM, ours by its method, and that of ours, of every case."""
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
            f"fewer trials than the document's {DOCUMENT_TRIALS}, so means are less certain: "
            f"{', '.join(few)}"
        )
    there = {view.id for experiment in experiments for view in experiment.views}
    missing = [name for name in WANTED if name not in there]
    if missing:
        yield (
            f"not in this folder: {', '.join(missing)}; python -m runtime reproduce all makes "
            "what there is"
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
        Tile("Consistent answers", share, "λ-Adam and our method, the worst case", tone),
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


def caption(view: SavedView) -> str:
    """`table-5.2` → Table 5.2."""
    match = re.fullmatch(r"(table|fig)-(.+)", view.id)
    if match is None:
        return view.title if not view.id.startswith("tables-") else f"Tables {view.id[7:]}"
    return f"{ {'table': 'Table', 'fig': 'Figure'}[match[1]] } {match[2]}"


def _cases(experiment: Experiment, view: SavedView) -> str:
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
        table=ReportTable(
            ("what", "value"),
            rows,
            kind="facts",
            row_anchors=(f"study-{experiment.name}", *("",) * (len(rows) - 1)),
        ),
        group="Where the numbers come from",
    )


def _text(value: object) -> str:
    if isinstance(value, str):
        return value
    rounded = json.loads(json.dumps(value), parse_float=lambda text: float(f"{float(text):.4g}"))
    return json.dumps(rounded, ensure_ascii=False).replace('"', "")
