"""Two results of one robot side by side: settings, torque errors, parameters and their differences.

    d = (x_b − x_a) / √(σ_a² + σ_b²)

is the difference in its standard deviations. Of m values in a table those differ whose |d| exceeds
the normal quantile of 1 − 0.05/(2 m) (Bonferroni): in 95 of 100 pairs of independent logs of an
unchanged robot no row is marked. σ contains the URDF as prior, so that values that neither log
determines agree by construction.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from scipy.special import ndtri

from runtime.common.tables import NOTHING, Table, number, percent
from runtime.errors import RecordingError
from runtime.identification.result_record import FrictionPart, ResultRecord
from runtime.identification.saved_result import FRAMES, SavedResult, differences
from runtime.recording.row_marks import SAME, share_of_rows

LEVEL = 0.05  # probability that a table of equal robots has a marked row


@dataclass(frozen=True, slots=True)
class TwoResults:
    """Tables and sentences that compare two results."""

    setup: Table  # what was identified, how and from which data; side by side
    errors: Table  # torque errors of both, each on the test part of its own log
    values: tuple[Table, ...]  # of links, base parameters, friction; differences are flagged
    sentences: tuple[str, ...]  # how many values of each table differ, and which
    notes: tuple[str, ...]  # what limits the comparison


def compare_results(a: SavedResult, b: SavedResult, names: tuple[str, str]) -> TwoResults:
    """Tables and sentences on two results of the same frames, whose headings are `names`."""
    first, second = a.record, b.record
    both_names, advice = f"'{names[0]}' and '{names[1]}'", "compare two results of one robot"
    if first.joints != second.joints or first.is_free != second.is_free:
        raise RecordingError(
            f"{both_names} have other joints ({first.robot}, {second.robot}); {advice}"
        )
    notes = [f"{both_names}: an old result does not state its model; the frames are taken as equal"]
    if first.model is not None and second.model is not None:
        links = [f"of {each.name}" for each in first.links]
        kinds = differences(first.model, second.model, names, links)
        if fault := next((sentence for kind, sentence in kinds if kind == FRAMES), None):
            raise RecordingError(f"{fault}; {advice}")
        notes = [sentence for _, sentence in kinds]
    if a.row_marks is not None and b.row_marks is not None:
        pair = (a.row_marks, b.row_marks)
        shared = max(share_of_rows(*pair), share_of_rows(*reversed(pair)))
        if shared > SAME:
            notes.append(
                f"the logs share {100 * shared:.0f} % of their rows, so that the two σ are not "
                "independent and the differences are smaller than they state"
            )
    if None in (first.uncertainty, second.uncertainty):
        notes.append("a result without uncertainty has no σ, and its differences have no size")
    both = zip(names, (first, second), strict=True)
    notes += [f"{name}: {doubt}" for name, each in both for doubt in each.doubts[:1]]
    parts = [_table(*each, names) for each in _values(first, second) if each[-1]]
    pairs = zip(_facts(first), _facts(second), strict=True)
    setup = tuple((label, x, y) for (label, x), (_, y) in pairs if x != NOTHING or y != NOTHING)
    return TwoResults(
        setup=Table(("", *names), setup, title="Setup", kind="facts"),
        errors=_errors(first, second, names),
        values=tuple(table for table, _ in parts),
        sentences=tuple(sentence for _, sentence in parts),
        notes=tuple(notes),
    )


def _facts(record: ResultRecord) -> tuple[tuple[str, str], ...]:
    log, shares = record.recording, record.torque_error_percent
    steps = ", ".join(
        f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
        for key, value in sorted(log.preparation.items())
    )
    known = record.uncertainty
    facts = (
        ("log", log.name),
        ("method", record.method),
        ("rows", ", ".join(f"{count} {part}" for part, count in log.samples.items() if count)),
        ("preparation", steps),
        ("friction", "" if record.friction is None else ", ".join(record.friction.columns)),
        ("torque error, URDF", percent(shares.before_overall)),
        ("torque error, identified", percent(shares.after_overall)),
        ("physically consistent", "yes" if record.consistent else "no"),
        ("effective sample size", known and f"{known.n_eff:.0f}"),
    )
    return tuple((label, text or NOTHING) for label, text in facts)


def _errors(a: ResultRecord, b: ResultRecord, names: tuple[str, str]) -> Table:
    rows_of = [
        {
            row: (percent(share), f"{number(rms)} {unit.replace('*', '·')}")
            for row, unit, share, rms in zip(
                *each.rows_of_errors,
                each.torque_error_percent.after,
                each.torque_rms.after,
                strict=True,
            )
        }
        for each in (a, b)
    ]
    rows = tuple(
        (row, *cells, *rows_of[1][row]) for row, cells in rows_of[0].items() if row in rows_of[1]
    )
    heads = [f"{what} {name}" for name in names for what in ("error", "RMS")]
    return Table(("joint", *heads), rows, title="Torque error, each on the test part of its log")


Value = tuple[str, float, float | None, float, float | None]  # name, first and σ, second and σ


def _values(a: ResultRecord, b: ResultRecord) -> Iterator[tuple[str, str, list[Value]]]:
    """Title, word and rows of the tables of parameters."""
    known = (a.uncertainty, b.uncertainty)
    masses: list[Value] = []
    for k, (one, two) in enumerate(zip(a.links, b.links, strict=False)):
        s, r = (None if u is None else u.links[k].mass_sigma for u in known)
        masses.append((one.name, one.mass, s, two.mass, r))
    yield "Masses [kg]", "masses of links", masses
    ends = ((each and each.beta_sigma) or (None,) * len(a.beta) for each in known)
    if len(a.beta) == len(b.beta):
        rows = zip(a.beta, next(ends), b.beta, next(ends), strict=True)
        title = "Base parameters [kg, kg·m, kg·m²], in the order of symgen describe"
        yield title, "base parameters", [(f"β{k + 1}", *row) for k, row in enumerate(rows)]
    first, second = a.friction, b.friction
    if first is None or second is None:
        return
    shared = [name for name in first.columns if name in second.columns]
    yield (
        "Friction [N·m, N; per rad/s, m/s]",
        "friction coefficients",
        [
            (f"{joint} {name}", *_coefficient(first, j, name), *_coefficient(second, j, name))
            for name in shared
            for j, joint in enumerate(a.joints)
        ],
    )


def _coefficient(friction: FrictionPart, joint: int, name: str) -> tuple[float, float | None]:
    k = friction.columns.index(name)
    return friction.values[joint][k], friction.sigma[joint][k] if friction.sigma else None


def _table(title: str, what: str, values: list[Value], names: tuple[str, str]) -> tuple[Table, str]:
    """Table of values, those that differ flagged, and the sentence on it."""
    bound = float(ndtri(1 - LEVEL / (2 * len(values))))
    rows = []
    for name, x, s, y, r in values:
        width = 0.0 if s is None or r is None else math.hypot(s, r)
        d = (y - x) / width if width else math.nan
        verdict = "differs" if abs(d) > bound else "agrees" if abs(d) <= bound else NOTHING
        size = f"{d:+.1f}" if width else NOTHING
        texts = (number(v) if e is None else f"{number(v)} ± {e:.2g}" for v, e in ((x, s), (y, r)))
        rows.append((name, *texts, number(y - x), size, verdict))
    flagged = [k for k, row in enumerate(rows) if row[-1] == "differs"]
    named = ", ".join(f"{rows[k][0]} ({rows[k][4]} σ)" for k in flagged)
    sentence = f"{what}: {len(flagged)} of {len(rows)} differ" + (f": {named}" if named else "")
    head = ("", *names, "difference", "in σ", "verdict")
    return Table(head, tuple(rows), title=title, flagged=frozenset(flagged)), sentence
