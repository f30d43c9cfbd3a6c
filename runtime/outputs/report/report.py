"""Result folder → `report.html`: one file without network access, reproducible byte for byte.

Mirrored limbs are one table, uncertainties two: σ per link, and residuals per joint. A comparison
of methods in the folder is appended; without `result.json` it is the whole page.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from runtime.common.tables import NOTHING, Table, number, percent, significant
from runtime.common.terminal import as_typed
from runtime.errors import ExportError
from runtime.estimators.regression.samples import NORMAL_95
from runtime.identification import result_record
from runtime.identification.result_tables import error_table, is_consistent, link_table, share_table
from runtime.identification.saved_result import read_predictions, read_record
from runtime.library import Array
from runtime.library.parameters import PI_NAMES
from runtime.outputs.report.comparison import comparison_page
from runtime.outputs.report.figures import convergence, mass_change, torques
from runtime.outputs.report.page import Page, Section, Tile, provenance, write_page
from runtime.recording.friction.columns import DAHL
from runtime.recording.settings import COLUMNS
from runtime.registry import Registry


def read_result(folder: Path) -> tuple[result_record.ResultRecord, dict[str, Array]]:
    """Read a result folder: its record, and measured, before and after (N, r) of the test part."""
    record = read_record(folder / "result.json")
    shape = (len(record.rows_of_errors[0]),)
    return record, read_predictions(folder, measured=shape, before=shape, after=shape)


def several_logs_sections(
    logs: result_record.SessionsPart, links: Sequence[str]
) -> tuple[Section, ...]:
    """Tables of the leave-one-log-out errors and of the repeatability."""
    repeated = logs.repeatability
    columns = (*repeated.masses, repeated.mass_spread)
    rows = tuple(
        (link, *(f"{masses[k]:.4f}" for masses in columns)) for k, link in enumerate(links)
    )
    return (
        Section(
            "Leave-one-log-out prediction",
            "Torque error over a whole log, predicted by the fit of all other logs with their mean "
            "offset or with the offset of this log. For comparison: the URDF, and a fit of this "
            "log alone.",
            left_out_table(logs),
        ),
        Section(
            "Repeatability",
            f"Masses [kg] identified from each log alone. {repeated.sentence[:1].upper()}"
            f"{repeated.sentence[1:]}.",
            Table(("link", *(each.name for each in logs.leave_one_out), "spread"), rows),
        ),
    )


def left_out_table(logs: result_record.SessionsPart) -> Table:
    """Torque errors of every log by the fit of all others, and for comparison."""
    head = ("log", "payload [kg]", "URDF", "other logs", "with its offset", "this log alone")
    rows = (
        (
            each.name,
            f"{payload:.3g}",
            *(
                percent(x, 3)
                for x in (
                    each.before_overall,
                    each.after_overall,
                    each.log_offset_overall,
                    each.single_log_overall,
                )
            ),
        )
        for each, payload in zip(logs.leave_one_out, logs.payload_kg, strict=True)
    )
    return Table(head, tuple(rows))


_PERCENT = "\N{NO-BREAK SPACE}%"
GLOSSARY = (
    ("torque error", "100 ‖measured − predicted‖ / ‖measured‖ over the test split, per joint"),
    ("before, after", "prediction by the URDF without friction; by all identified parameters"),
    ("test split", "samples that neither the fit nor its stopping rule used"),
    ("consistent", "some body of positive density has these parameters: P ⪰ 0"),
    ("P", "pseudo-inertia of a link, 4×4; λ_min(P)/tr P < 0 is physically inconsistent"),
    ("gap", "(loss − optimum) / optimum, with the certified optimum of the convex problem"),
)


# --- summary --------------------------------------------------------------------------------


def headline(result: result_record.ResultRecord) -> str:
    """Torque errors and physical consistency of a result in one sentence."""
    before, after = _overall(result)
    if math.isnan(before) or math.isnan(after):
        change = f"is {percent(after)} (before: {percent(before)})"
    elif percent(before) == percent(after):
        change = f"is unchanged at {percent(after)}"
    else:
        verb = "decreased" if after < before else "increased"
        change = f"{verb} from {percent(before)} to {percent(after)}"
    bad = [link.name for link in result.links if not is_consistent(link)]
    end = f"not physically consistent: {', '.join(bad) or 'at least one link'}"
    if result.consistent:
        end = "all links are physically consistent"
    is_trained = result.recording.samples.get("test") == 0
    part = "training data (no test split)" if is_trained else "test split"
    return f"The torque error on the {part} {change}; {end}."


def tiles(result: result_record.ResultRecord) -> tuple[Tile, ...]:
    """The four numbers of the summary."""
    before, after = _overall(result)
    eigenvalues = (_value(link.min_relative_eigenvalue) for link in result.links)
    smallest = min(eigenvalues, default=math.nan)
    gap = result.gap_to_convex_optimum
    shown = "not computed" if gap is None else f"{significant(100 * gap, 3)}{_PERCENT}"
    effort = NOTHING if result.seconds is None else f"{result.seconds:.3g} s"
    counted = "computing time" if result.iterations is None else f"{result.iterations} iterations"
    return (
        Tile(
            "Torque error, overall",
            f"{percent(before)} → {percent(after)}",
            "test split, before → after",
            "good" if before > after else "bad" if before < after else "plain",
        ),
        Tile(
            "Physically consistent",
            "yes" if result.consistent else "no",
            f"smallest λ_min(P)/tr P: {smallest:.1e}",
            "good" if result.consistent else "bad",
        ),
        Tile("Gap to the convex optimum", shown, "(loss − optimum) / optimum"),
        Tile("Computing time", effort, counted),
    )


def sections(record: result_record.ResultRecord, rows: Mapping[str, Array]) -> Iterator[Section]:
    """Sections of the page below the summary, in their order."""
    names, units = record.rows_of_errors
    links = tuple(link.name for link in record.links)
    yield Section(
        "Torque error per joint",
        "On the test split, before (URDF without friction) and after (all identified parameters).",
        error_table(names, units, record.torque_error_percent, record.torque_rms),
    )
    if (shares := share_table(record)) is not None:
        yield Section(
            "Share of friction and inertia",
            "The step from the first to the second row is due to friction alone, the step to the "
            "third to the inertial parameters.",
            shares,
        )
    yield Section(
        "Measured and predicted torque",
        "Left: torque over the test split. Right: measured minus predicted torque.",
        figure=torques(names, [_unit(unit) for unit in units], **rows),
    )
    yield Section(
        "Physical consistency per link",
        "A motion determines the base parameters, which combine several links. The mass or the "
        "centre of mass of a single link may therefore be uncertain although the torques are "
        "predicted well.",
        link_table(record.links),
    )
    if record.sessions is not None:
        yield from several_logs_sections(record.sessions, links)
    if record.symmetric:
        yield Section(
            "Left and right",
            "Values of mirrored joints with their 95 % intervals; friction is viscous and Coulomb. "
            "The distance is in standard deviations of the difference. Pairs that disagree are "
            "explained among the warnings.",
            Table(
                ("left", "right", "quantity", "value left", "value right", "agree"),
                tuple(map(_row, record.symmetric)),
            ),
        )
    if record.uncertainty is not None:
        yield from uncertainty_sections(record.uncertainty, record.joints, links)
    if links:
        yield _masses(record, links)
    if record.friction is not None:
        yield _friction(record.joints, record.friction)
    if (c := record.convergence) is not None and c.iteration:
        validation = c.validation or (None,) * len(c.iteration)
        losses = (np.array(list(map(_value, each))) for each in (c.training, validation))
        yield Section("Convergence", figure=convergence(np.array(c.iteration), *losses))
    yield _preparation(record)
    yield _provenance(record)


# --- sections -------------------------------------------------------------------------------


def _masses(result: result_record.ResultRecord, links: Sequence[str]) -> Section:
    known = result.uncertainty
    before = np.array([link.mass_before for link in result.links])
    now = np.array([link.mass for link in result.links])
    sigma = None if known is None else np.array([link.mass_sigma for link in known.links])
    drawn = mass_change(links, before, now, sigma)
    return Section("Change of mass", figure=drawn)


def _friction(joints: Sequence[str], friction: result_record.FrictionPart) -> Section:
    pairs = zip(joints, friction.values, strict=True)
    rows = tuple((joint, *(number(value) for value in values)) for joint, values in pairs)
    coupled = any(name in COLUMNS and COLUMNS[name].of_motors for name in friction.columns)
    sign = f" The smooth sign of the velocity is tanh(dq / {friction.coulomb_speed:g})."
    if DAHL.name in friction.columns:
        sign = " After a reversal dahl goes from −1 to 1 within a short travel."
    motors = " Columns motor_… belong to motors; a motor acts on all joints that it drives."
    return Section(
        "Friction",
        "Coefficients in the unit of the joint torque, viscous coefficients per rad/s (m/s)."
        f"{sign}{motors if coupled else ''}",
        Table(("joint", *map(_unit, friction.columns)), rows),
    )


def _preparation(result: result_record.ResultRecord) -> Section:
    recording = result.recording
    counts = ", ".join(f"{count} {name}" for name, count in recording.samples.items())
    length = "" if recording.duration is None else f"{recording.duration:.4g} s of motion. "
    lead = f"{length}Samples: {counts or 'not recorded'}. {recording.split}".strip()
    return Section("Data preparation", lead, items=recording.history or ("no step was recorded",))


def _provenance(result: result_record.ResultRecord) -> Section:
    p = result.provenance
    weights = ", ".join(number(w) for w in result.weights)
    condition = None if result.condition_number is None else f"{result.condition_number:.3g}"
    return provenance(
        *(p.command, p.seed, p.model_hash, p.versions, p.files),
        ("condition number, columns normalised", condition),
        ("weights per joint", weights),
    )


# --- numbers as text -----------------------------------------------------------------------


def _overall(result: result_record.ResultRecord) -> tuple[float, float]:
    """Errors of all joints together before and after [%]."""
    shares = result.torque_error_percent
    return _value(shares.before_overall), _value(shares.after_overall)


def _value(value: float | None) -> float:
    """A number of the file; NaN for null."""
    return math.nan if value is None else value


def _unit(unit: str) -> str:
    return unit.replace("*", "·")


def _row(pair: result_record.MirroredPair) -> tuple[str, ...]:
    sides = [
        ", ".join(f"{v:.4g} ± {NORMAL_95 * s:.2g}" for v, s in zip(values, sigma, strict=True))
        for values, sigma in zip(pair.values, pair.sigma, strict=True)
    ]
    verdict = "yes" if pair.agrees else "no"
    return (pair.left, pair.right, pair.quantity, *sides, f"{verdict} ({pair.distance:.1f} σ)")


def _named(verdicts: tuple[str, ...], word: str) -> str:
    """Names of the parameters with a verdict."""
    names = [name for name, each in zip(PI_NAMES, verdicts, strict=True) if each == word]
    return " ".join(names) or "–"


def uncertainty_sections(
    s: result_record.UncertaintyPart, joints: tuple[str, ...], links: tuple[str, ...]
) -> tuple[Section, ...]:
    """Tables of the σ of the links and of the residuals."""
    words = ("identified", "prior-dominated", "unobservable")
    of_links = tuple(
        (
            name,
            f"{link.mass_sigma:.3g}",
            "–" if link.com_sigma is None else f"{1e3 * float(np.max(link.com_sigma)):.2g}",
            *(_named(link.verdicts, word) for word in words),
        )
        for name, link in zip(links, s.links, strict=True)
    )
    of_joints = tuple(
        (
            joint,
            f"{noise:.3g}",
            f"{band:.2g}",
            f"{100 * white:.0f}{_PERCENT}",
            *(
                "any" if share is None or share >= 1 else f"{significant(100 * share)}{_PERCENT}"
                for share in s.detectable_gain_error[k : k + 1]
            ),
        )
        for k, (joint, noise, band, white) in enumerate(
            zip(joints if s.noise else (), s.noise, s.model_band, s.white_lag_share, strict=True)
        )
    )
    heads: tuple[str, ...] = (
        "joint",
        "residual RMS",
        "model σ",
        "lags within the white-noise band",
    )
    hidden = ""
    if s.detectable_gain_error:
        heads = (*heads, "gain error that may go unnoticed")
        hidden = (
            " Last column: a torque gain that is wrong by up to this share, relative to the other "
            "joints, may leave no trace in such a log."
        )
    advice = as_typed(s.advice)
    edge = " A link is close to the limit of physical consistency." if s.boundary else ""
    sections = (
        Section(
            "Uncertainty of the links",
            f"{advice[:1].upper()}{advice[1:]}.{edge} σ is computed with the URDF as "
            "prior. A parameter is identified where the data reduce its prior variance at least "
            "tenfold: its interval is that of the log. Prior-dominated parameters keep the value "
            "and uncertainty of the URDF, and unobservable ones have no effect on the torque.",
            Table(("link", "σ mass [kg]", "σ CoM [mm]", *words), of_links),
        ),
        Section(
            "Residuals",
            f"Effective sample size of the training residuals: {s.n_eff:.0f} (variance inflation "
            f"{s.inflation:.1f}). Model σ: standard deviation of the torque due to uncertain "
            f"parameters.{hidden}",
            Table(heads, of_joints),
        ),
    )
    return sections if s.noise else sections[:1]


@dataclass(frozen=True, slots=True, eq=False)
class ReportKind:
    """Folders with results of another kind, which have a page of their own."""

    name: str  # what wrote the folder
    accepts: Callable[[Path], bool]  # whether a folder has such results
    pictures: Callable[[Path, Path], tuple[Path, ...]]  # files that `write` puts into a folder
    write: Callable[..., tuple[Path, ...]]  # the page, requested tables and figures; the files


REPORT_KINDS = Registry(
    "symgen.reports",
    ReportKind,
    "kind of results",
    {"experiments": "runtime.experiments.report:EXPERIMENTS"},
)


def write_report(folder: str | PathLike[str], out: str | PathLike[str] | None = None) -> Path:
    """Write `report.html` from the files of a result folder.

    Args:
        folder: output folder of an identification (`result.json` and `predictions.npz`), of a
            comparison (`compare.json`), or both.
        out: file to write; default `report.html` in the folder.

    Returns:
        Path of the report.

    Raises:
        RuntimeFault: a file is missing or damaged, or the report cannot be written.
    """
    if not isinstance(folder, str | PathLike):
        raise ExportError(f"expected the folder of a result, got {folder!r:.60}")
    folder = Path(folder)
    methods = comparison_page(folder)
    if methods is not None and not (folder / "result.json").exists():
        shown = methods
    else:
        shown = _page(*read_result(folder))
        if methods is not None:  # without its provenance
            shown = replace(shown, sections=(*shown.sections, *methods.sections[:-1]))
    return write_page(shown, folder / "report.html" if out is None else Path(out))


def _page(record: result_record.ResultRecord, rows: Mapping[str, Array]) -> Page:
    name = record.recording.name or "unnamed recording"
    return Page(
        title=f"{record.robot}, {record.method}: identification report",
        subtitle=f"{record.robot} · method {record.method} · {name}",
        headline=headline(record),
        status=record.status or "",
        warnings=tuple(map(as_typed, record.doubts)),
        notes=tuple(as_typed(each) for each in record.warnings if each not in record.doubts),
        tiles=tiles(record),
        sections=tuple(sections(record, rows)),
        glossary=GLOSSARY,
    )
