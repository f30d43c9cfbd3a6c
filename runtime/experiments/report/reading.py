"""A folder of experiments → frozen `Experiment`s, each checked against its files.

`result.json` holds the SHA-256 of `trials.parquet` and `series.npz`. Its config hash must equal
those of `config.json` and of the trials, and its summary must follow from the trials. An unfinished
study gives a note, a damaged one an error.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from runtime.common.files import json_of, require_file, sha256_of
from runtime.common.records import record_from_table
from runtime.errors import RecordingError, RuntimeFault
from runtime.experiments.storage import CONFIG, RESULT, SERIES, TRIALS, read_rows, summary
from runtime.experiments.study import FORMAT, View
from runtime.library import Array
from runtime.recording.formats.npz import open_npz

LARGEST_DRAWN = 1e100  # largest number that is drawn; its square must be finite

_LINES = {"band": 3, "loglog": 3}  # number of series of one axis, by kind of figure


def is_drawable(kind: str, series: Sequence[Array], names: Sequence[str]) -> bool:
    """Whether series have the shapes that a kind of figure needs."""
    shapes = [values.shape for values in series]
    sizes = [np.abs(values[np.isfinite(values)]).max(initial=0.0) for values in series]
    is_empty = any(not shape or shape[0] < 1 for shape in shapes)
    if is_empty or max(sizes, default=0.0) > LARGEST_DRAWN:
        return False
    if kind in _LINES:
        return len(series) == _LINES[kind] and set(shapes) == {(shapes[0][0],)}
    if kind == "path":
        one = bool(shapes) and shapes[0][1:] in {(3,), (4, 4)}
        return one and bool(np.isfinite(series[0]).all())
    if kind == "motion":
        same = len(set(shapes[1:])) == 1 and len(shapes[-1]) == 2
        return len(series) == 5 and same and shapes[0] == shapes[1][:1]
    return kind != "lines" or _are_curves(shapes, names)


def _are_curves(shapes: Sequence[tuple[int, ...]], names: Sequence[str]) -> bool:
    """Whether all curves share one x, or each one has its own iterations; for one or n joints."""
    if all(name.endswith("iteration") for name in names[::2]):
        pairs = list(zip(shapes[::2], shapes[1::2], strict=False))
        whole = len(shapes) % 2 == 0
    else:
        pairs, whole = [(shapes[0], shape) for shape in shapes[1:]], len(shapes) > 1
    same = len({len(y) for _, y in pairs}) == 1
    return (
        whole and same and all(len(x) == 1 and len(y) in {1, 2} and x[0] == y[0] for x, y in pairs)
    )


KINDS = ("table", "band", "lines", "path", "motion", "loglog", "bars")
AGREEMENT = 1e-9  # relative difference of summary and trials; sums of doubles depend on their order
WANTED = (  # Tables and figures of the document, by id
    *("fig-3.1", "fig-3.2", "excitation", "fig-3.3", "fig-4.1"),
    *(f"table-5.{k}" for k in (2, 3, 4, 5, 6, 7, 9, 10, 11, 12)),
    *(f"fig-5.{k}" for k in (1, 2, 3, 4, 5, 7, 8)),
    *("fig-A.1", "fig-A.2", "fig-A.3", "fig-A.4", "tables-B"),
)
BEST = ("map-friction", "map", "lm")
"""Method of this package that is compared with the document: the first one that a study has.

Without noise it is lm, which starts from MAP.
"""
_AGAIN = "run again: python -m runtime reproduce"


@dataclass(frozen=True, slots=True)
class Value:
    """Mean, standard deviation (None for a single number) and count of one metric."""

    mean: float
    std: float | None = None
    n: int | None = None
    quartiles: tuple[float, ...] = ()  # first quartile, median, third; empty without them
    misprint: str = ""  # number that the document prints in its place; empty where it is the same


MetricKey = tuple[str, str, str]  # case, method, metric
Values = Mapping[MetricKey, Value]


@dataclass(frozen=True, slots=True)
class Experiment:
    """Content of the folder of one study."""

    name: str  # name of its folder
    title: str
    trials: int
    config_hash: str
    joints: tuple[str, ...]
    cases: Mapping[str, str]
    methods: Mapping[str, str]
    views: tuple[View, ...]
    series: Mapping[str, Array]
    values: Values
    document: Mapping[str, Values]  # numbers of the document by id, then by key
    source: Mapping[str, str]  # their table or figure in the document, by id
    facts: Mapping[str, Any]
    provenance: tuple[tuple[str, str], ...]  # (quantity, value) pairs

    @property
    def short_hash(self) -> str:
        """First 12 digits of the config hash."""
        return self.config_hash[:12]

    @property
    def best_method(self) -> str:
        """First of `BEST` that the study has; "" where it has none."""
        return next((name for name in BEST if name in self.methods), "")

    def best(self, case: str, metric: str) -> Value | None:
        """Number of the best method."""
        return self.values.get((case, self.best_method, metric))

    def cases_of(self, view: View) -> tuple[str, ...]:
        """Cases of a view; all cases where it names none."""
        return view.cases or tuple(self.cases)


def is_experiments(folder: Path) -> bool:
    """Whether a folder is a study or holds studies, finished or not."""
    return bool(_places(folder))


def read_experiments(folder: Path) -> tuple[tuple[Experiment, ...], tuple[str, ...]]:
    """Read the finished studies of a folder, and a sentence for each unfinished one."""
    finished, notes = [], []
    for place in _places(folder):
        if (place / RESULT).exists():
            finished.append(read_experiment(place))
        else:
            notes.append(f"{place.name} is not finished and is omitted; {_AGAIN}")
    if not finished:
        raise RuntimeFault(f"'{folder}' holds no finished experiment; {_AGAIN}")
    return tuple(sorted(finished, key=_first)), tuple(notes)


def _first(experiment: Experiment) -> tuple[int, str]:
    """Sort key: position in the document."""
    places = [WANTED.index(view.id) for view in experiment.views if view.id in WANTED]
    return min(places, default=len(WANTED)), experiment.name


def _places(folder: Path) -> list[Path]:
    inside = [path for path in sorted(folder.glob("*/")) if (path / CONFIG).is_file()]
    return [folder] if (folder / CONFIG).is_file() else inside


def read_experiment(folder: Path) -> Experiment:
    """Read one study."""
    path = folder / RESULT
    try:
        raw = json_of(path)
        known = json_of(folder / CONFIG)
        if raw["format"] != FORMAT:
            raise ValueError(f"format {FORMAT}")
        _require_whole(folder, raw, known)
        file = open_npz((folder / SERIES).read_bytes(), SERIES)
        series = {name: np.array(values, dtype=float) for name, values in file.items()}
        for values in series.values():
            values[np.isinf(values)] = np.nan  # a gap of the curve, from which bands follow
        return _experiment(raw, series)
    except OSError as error:
        name = Path(error.filename or path).name
        raise RuntimeFault(
            f"cannot read '{folder / name}' ({error.strerror or error}); {_AGAIN}"
        ) from None
    except (RecordingError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise RuntimeFault(f"'{path}' is damaged (no valid {error}); {_AGAIN}") from None


def _require_whole(folder: Path, raw: Mapping[str, Any], known: Mapping[str, Any]) -> None:
    for name in (TRIALS, SERIES):
        if sha256_of(require_file(folder / name)) != raw["files"][name]:
            raise RuntimeFault(
                f"'{folder / name}' does not match its SHA-256 in {RESULT}; {_AGAIN}"
            )
    same = all(raw[key] == known[key] for key in ("config_hash", "config"))
    rows = read_rows(folder / TRIALS, raw["config_hash"]) if same else None
    if rows is None:
        raise RuntimeFault(f"the files of '{folder}' have different configs; {_AGAIN}")
    with np.errstate(all="ignore"):  # overflow gives infinity, which agrees with no number
        computed = {_key(entry): entry for entry in summary(rows)}
    stated = {_key(entry): entry for entry in raw["summary"]}
    both = computed.keys() & stated.keys()
    wrong = {k for k in both if not _agrees(stated[k], computed[k])}
    wrong |= computed.keys() ^ stated.keys()
    if wrong:
        words = " ".join(min(wrong))
        raise RuntimeFault(
            f"the summary of '{folder / RESULT}' differs from its trials ({words}); {_AGAIN}"
        )


def _key(entry: Mapping[str, Any]) -> MetricKey:
    return entry["case"], entry["method"], entry["metric"]


def _agrees(stated: Mapping[str, Any], computed: Mapping[str, Any]) -> bool:
    """Whether an entry of a summary, of older files without quartiles, is the computed one."""
    quartiles = stated.get("quartiles") or computed["quartiles"]
    pairs = list(zip(quartiles, computed["quartiles"], strict=True))
    pairs.append((stated["mean"], computed["mean"]))
    has_std = computed["std"] is not None
    if has_std and stated["std"] is not None:
        pairs.append((stated["std"], computed["std"]))
    scale = max(abs(number) for _, number in pairs)
    near = all(math.isclose(a, b, rel_tol=AGREEMENT, abs_tol=AGREEMENT * scale) for a, b in pairs)
    return stated["n"] == computed["n"] and has_std == (stated["std"] is not None) and near


def _experiment(raw: Mapping[str, Any], series: dict[str, Array]) -> Experiment:
    values = {
        _key(e): Value(e["mean"], e["std"], e["n"], tuple(e.get("quartiles", ())))
        for e in raw["summary"]
    }
    document: dict[str, dict[MetricKey, Value]] = {}
    for e in raw["document"]:
        misprint = str(e.get("misprint", ""))
        document.setdefault(e["id"], {})[_key(e)] = Value(e["mean"], e["std"], misprint=misprint)
    views = tuple(_view(entry, series) for entry in raw["views"])
    views = tuple(_with_document(view, views, document) for view in views)
    return Experiment(
        name=str(raw["study"]),
        title=str(raw["title"]),
        trials=int(raw["trials"]),
        config_hash=str(raw["config_hash"]),
        joints=tuple(map(str, raw["joints"])),
        cases=dict(raw["cases"]),
        methods=dict(raw["methods"]),
        views=views,
        series=series,
        values=values,
        document=document,
        source={e["id"]: str(e["source"]) for e in raw["document"]},
        facts=dict(raw["facts"]),
        provenance=_provenance(raw),
    )


def _view(raw: Mapping[str, Any], series: Mapping[str, Array]) -> View:
    view = record_from_table(View, raw, "a view", ValueError)
    view = replace(view, document=view.document or view.id)
    missing = [name for name in view.series if name not in series]
    if view.kind not in KINDS or missing:
        raise ValueError(f"view '{view.id}': kind '{view.kind}', missing series {missing}")
    if not is_drawable(view.kind, [series[name] for name in view.series], view.series):
        shapes = ", ".join(str(series[name].shape) for name in view.series)
        raise ValueError(f"view '{view.id}': a figure '{view.kind}' of series of {shapes}")
    return view


def _with_document(view: View, views: tuple[View, ...], document: Mapping[str, Values]) -> View:
    """Add to bars the document numbers of the first table with the same cases and metrics."""
    if view.kind != "bars" or view.document in document:
        return view
    for other in views:
        available = {metric for _, _, metric in document.get(other.document, {})}
        if other.cases == view.cases and available & set(view.metrics):
            return replace(view, document=other.document)
    return view


def _provenance(raw: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    facts: list[tuple[str, Any]] = [
        ("config hash", raw["config_hash"]),
        ("command", raw["command"]),
        ("trials", raw["trials"]),
        ("robot", raw["robot"]),
        ("model hash", raw["model_hash"]),
        ("versions", ", ".join(f"{k} {v}" for k, v in sorted(raw["versions"].items()))),
        *((f"SHA-256 of {name}", digest) for name, digest in sorted(raw["files"].items())),
        ("config", json.dumps(raw["config"], ensure_ascii=False)),
    ]
    return tuple((word, str(value)) for word, value in facts)
