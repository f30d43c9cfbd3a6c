"""Advice on the choice of a method, by fixed rules, written as compare.json, compare.md and a page.

MAP is recommended unless it has no consistent result, or another strictly consistent method
predicts the validation part significantly better. The test part has no share in the choice, so that
the test error of the recommended method is that of data that nothing was fitted or chosen on.
Means of contiguous blocks of the validation part are nearly independent although neighbouring
residuals are not: t = mean(d)/(std(d)/√B) of the block means of d, the difference of squared
errors. Source: Diebold & Mariano 1995 for testing d; Law & Kelton for means of batches.
"""

import html
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import stdtrit

from runtime.common.files import replacing, write_json
from runtime.common.tables import significant
from runtime.estimators.methods import DEFAULT, METHODS
from runtime.identification.comparison.run import RAN, Comparison, Figures, MethodRow, row_facts
from runtime.identification.problem_setup import PARTS
from runtime.identification.result_record import plain
from runtime.identification.result_tables import NOT_RUN, method_table
from runtime.library import Array
from runtime.library.manifest import file_units
from runtime.recording import Recording

UNCONSTRAINED = "ols"  # method whose growth of the error from training to test shows over-fitting
BLOCKS = 10
LEVEL = 0.95
WORTHWHILE = 0.01  # relative reduction of the torque error below which a method is not better
ENOUGH = 0.5  # share of the base parameters below which the data count as dominated by the prior
OVERFIT = 1.1
"""Growth of the error of OLS from training to test over that of the recommended method, above which
OLS over-fits."""


@dataclass(frozen=True, slots=True)
class Advice:
    """Recommended method with the reasons."""

    take: str | None  # name of the method; None where no result should be used
    sentences: tuple[str, ...]  # reasons and remarks


def advise(rows: Sequence[MethodRow], n_base: int) -> Advice:
    """Advice on the rows of one comparison."""
    ran = {row.method: row.figures for row in rows if row.figures is not None}
    if not ran:
        why = "No method has a result on these data; the reason of each is in its row"
        return Advice(None, (why,))
    sound = {name: f for name, f in ran.items() if f.consistent}
    if not sound:
        best = _best(ran)
        return Advice(
            None,
            (
                f"No method that ran is physically consistent ({', '.join(ran)}); {best} predicts "
                "torques best, but use none of them in a simulator or a controller: run map",
            ),
        )
    take, why = _choice(sound)
    # Assumptions of the recommended result that the data contradict, as `identify` states them.
    doubt = "; ".join(ran[take].model_errors)
    if ran[take].contradictions:
        doubt = f"do not trust it or its intervals yet: {ran[take].contradictions[0]}"
    sentences = [
        f"take {take}: {why}",
        doubt,
        *_consistency(ran, take),
        _boundary(sound, take),
        _prior(ran[take], take, n_base),
        _overfit(ran, take),
        _truth(ran, take),
        _absent(rows),
    ]
    return Advice(take, tuple(text[0].upper() + text[1:] for text in sentences if text))


def better_beyond_chance(a: Array, b: Array) -> bool:
    """Whether squared errors a are significantly smaller than b: two-sided t-test at `LEVEL`."""
    count = min(BLOCKS, len(a) // 2)
    if count < 3:
        return False
    means = np.array([part.mean() for part in np.array_split(b - a, count)])
    spread = float(means.std(ddof=1)) / np.sqrt(count)
    if spread == 0:
        return bool(means.mean() > 0)
    return bool(means.mean() / spread > stdtrit(count - 1, (1 + LEVEL) / 2))


def _choice(sound: dict[str, Figures]) -> tuple[str, str]:
    """The recommended one of the consistent methods, and the reason."""
    inside = {name: f for name, f in sound.items() if not f.boundary}
    if DEFAULT not in sound:
        take = _best(inside or sound)
        which = "results off the boundary of consistency" if inside else "consistent results"
        return take, f"the best prediction of all {which} ({DEFAULT} has none)"
    rivals = {
        name: f for name, f in inside.items() if name != DEFAULT and _beats(f, sound[DEFAULT])
    }
    if not rivals:
        others = "other consistent result"
        if len(inside) < len(sound):
            others += " off the boundary of consistency"
        return DEFAULT, (
            "the default; its links are physically consistent, it states its uncertainty, and no "
            f"{others} predicts significantly better"
        )
    take = _best(rivals)
    reason = (
        f"its links are physically consistent and its validation error, {_held(sound[take])}, is "
        f"significantly below the {_held(sound[DEFAULT])} of {DEFAULT}"
    )
    if more := METHODS[take].when_recommended:
        reason += f"; {more}"
    return take, reason


def _consistency(ran: dict[str, Figures], take: str) -> list[str]:
    """Which results are consistent, and whether another one predicts better."""
    bad = {name: f for name, f in ran.items() if not f.consistent}
    if not bad:
        return ["every result is physically consistent"]
    verdict = (
        f"physically consistent: {', '.join(n for n in ran if n not in bad) or 'none'}; not "
        f"consistent: {', '.join(bad)}, which must not be used in a simulator"
    )
    best = _best(bad)
    figures = f"{_held(bad[best])} against {_held(ran[take])} on the validation part"
    gain = (
        f"inconsistency brings no gain: {best}, the best of the inconsistent results, does not "
        f"predict significantly better ({figures})"
    )
    if _beats(bad[best], ran[take]):
        gain = (
            f"the best inconsistent result, {best}, predicts significantly better ({figures}): "
            "either its additional freedom replaces effects that the model lacks, mostly friction, "
            "or the URDF is a poor prior; use it only for torques of similar motions"
        )
    return [verdict, gain]


def _boundary(sound: dict[str, Figures], take: str) -> str:
    edge = [name for name, f in sound.items() if f.boundary]
    if not edge:
        return ""
    sentence = (
        f"on the boundary of consistency: {', '.join(edge)}; a link there is a plate or a rod, "
        "which is a limit of the constraints rather than a measurement"
    )
    left_out = [name for name in edge if name not in {take, DEFAULT}]
    if left_out:
        sentence += f", so that {', '.join(left_out)} had no share in the choice"
    better = {name: sound[name] for name in left_out if _beats(sound[name], sound[take])}
    if better:
        best = _best(better)
        sentence += (
            f", although {best} predicts significantly better ({_held(sound[best])} against "
            f"{_held(sound[take])} of {take} on the validation part)"
        )
    return sentence


def _prior(f: Figures, take: str, n_base: int) -> str:
    if f.excited < n_base:
        return (
            f"the motion excites {f.excited} of {n_base} base parameters, the others are those of "
            "the URDF; record a motion that moves every joint (excite designs one)"
        )
    shares = (
        f"the data determine {f.determined} of {n_base} independent combinations of parameters, "
        "the prior the others"
    )
    if f.determined < ENOUGH * n_base:
        return (
            f"{shares}: {take} is close to the URDF because the data contain little information; "
            "record a longer or faster motion, or improve the friction model"
        )
    return shares


def _overfit(ran: dict[str, Figures], take: str) -> str:
    if UNCONSTRAINED not in ran or take == UNCONSTRAINED:
        return ""
    ends = [(f.train_percent, f.test_percent) for f in (ran[UNCONSTRAINED], ran[take])]
    free, taken = (f"{first:.3g} to {significant(last, 3)} %" for first, last in ends)
    change = f"from {free} between training and test, that of {take} from {taken}"
    growth, usual = (last / max(first, 1e-300) for first, last in ends)
    if growth > OVERFIT * usual:
        return f"unconstrained least squares over-fits: the error of {UNCONSTRAINED} grows {change}"
    return f"least squares does not over-fit: the error of {UNCONSTRAINED} changes {change}"


def _truth(ran: dict[str, Figures], take: str) -> str:
    errors = {name: e for name, f in ran.items() if (e := f.base_error_percent) is not None}
    if not errors:
        return ""
    best = min(errors, key=lambda name: errors[name])
    nearest = (
        f"the true parameters are known: the base parameters of {best} have the smallest error, "
        f"{significant(errors[best], 3)} %"
    )
    return (
        nearest if best == take else f"{nearest}, those of {take} {significant(errors[take], 3)} %"
    )


def _absent(rows: Sequence[MethodRow]) -> str:
    missing = [row.method for row in rows if row.outcome == NOT_RUN]
    failed = [row.method for row in rows if row.outcome not in {NOT_RUN, RAN}]
    parts = [f"not run: {', '.join(missing)}"] if missing else []
    parts += [f"failed: {', '.join(failed)}"] if failed else []
    return f"{'; '.join(parts)}, each for the reason in its row" if parts else ""


def _beats(a: Figures, b: Figures) -> bool:
    """Whether the torque error is smaller by `WORTHWHILE` and the difference is significant."""
    is_smaller = a.validation_percent < (1 - WORTHWHILE) * b.validation_percent
    return is_smaller and better_beyond_chance(a.squares, b.squares)


def _best(ran: dict[str, Figures]) -> str:
    return min(ran, key=lambda name: ran[name].validation_percent)


def _held(f: Figures) -> str:
    return f"{significant(f.validation_percent, 3)} %"


FORMAT = 1


def write_comparison(
    done: Comparison, folder: Path, command: str, options: Mapping[str, Any], notes: tuple[str, ...]
) -> dict[str, Any]:
    """Write compare.json and compare.md."""
    assembly, truth = done.assembly, done.truth
    lib = assembly.problem.lib
    advice = advise(done.rows, len(lib.base_columns))
    parts = {name: _extent(assembly.recordings(name)) for name in PARTS}
    train, shown = assembly.parts[0], assembly.shown
    names = (lib.joint_names, file_units(lib.manifest)) if shown is None else shown.rows
    one_run = (
        "training and test are parts of one run, which underestimates the error of every method",
    )
    facts = {
        "format": FORMAT,
        "robot": lib.name,
        "joints": list(names[0]),
        "units": list(names[1]),
        "recording": {
            "name": train.name.removesuffix("/train"),
            "samples": {name: count for name, (count, *_) in parts.items()},
            "spans": {name: span for name, (_, *span) in parts.items()},
            "history": list(train.history),
        },
        "friction": assembly.friction.facts(),
        "weights": assembly.problem.weights.tolist(),
        "before_percent": done.before,
        "convex_optimum": plain(done.optimum),
        "rows": [row_facts(row) for row in done.rows],
        "advice": {"take": advice.take, "sentences": list(advice.sentences)},
        "notes": [*notes, *(one_run if assembly.one_run else ())],
        "provenance": {
            "command": command,
            "options": dict(options),
            "versions": lib.versions,
            "files": dict(train.source) | ({truth.name: truth.sha256} if truth else {}),
            "model_hash": lib.manifest.model_hash,
            "seed": assembly.problem.seed,
        },
    }
    write_json(folder / "compare.json", facts)
    with replacing(folder / "compare.md") as file:
        file.write(_markdown(facts).encode())
    return facts


def _extent(pieces: Iterable[Recording]) -> tuple[int, float, float]:
    """Number of rows, first and last instant [s]."""
    ends = [(len(piece), float(piece.t[0]), float(piece.t[-1])) for piece in pieces]
    return sum(count for count, *_ in ends), ends[0][1], ends[-1][2]


LEGEND = (
    "train and error: torque error on the training and the test part, all joints; worst RMS: "
    "number and RMS error of the worst joint, N·m or N; base: error of the base parameters where "
    "the true ones are known; λ_min/tr: smallest relative eigenvalue, below 0 is not consistent; "
    "gap: (L − L*)/L* in the weighted training loss that all rows share, L* the optimum over all "
    "consistent models without nets"
)


def _markdown(facts: Mapping[str, Any]) -> str:
    joints, units, rows = facts["joints"], facts["units"], facts["rows"]
    name = _plain(facts["recording"]["name"])
    lines = [f"# {facts['robot']}, {name}: every method on the same data", ""]
    lines += [f"- {_plain(sentence)}" for sentence in facts["advice"]["sentences"]]
    table = method_table(rows)
    lines += ["", _line(table.header), "|---" * len(table.header) + "|", *map(_line, table.rows)]
    lines += [
        "",
        f"The URDF without friction has {facts['before_percent']:.3f} %. {LEGEND}.",
        "",
        _line(("RMS on test", *joints)),
        "|---" * (len(joints) + 1) + "|",
        _line(("unit", *(unit.replace("*", "·") for unit in units))),
    ]
    lines += [
        _line((row["method"], *(f"{x:.4f}" for x in row["rms"]))) for row in rows if "rms" in row
    ]
    lines += ["", *(f"- {row['method']}: {_plain(row['status'])}" for row in rows)]
    lines += ["", *(f"- {_plain(note)}" for note in facts["notes"])]
    return "\n".join(lines) + "\n"


def _line(words: tuple[str, ...]) -> str:
    return "| " + " | ".join(_plain(word.replace("|", "/")) for word in words) + " |"


def _plain(text: str) -> str:
    """Text in one line without Markdown or HTML: names of joints and logs come from elsewhere."""
    flat = "".join(c if c.isprintable() else "_" for c in text)
    return re.sub(r"([\\`*\[\]|])", r"\\\1", html.escape(flat, quote=False))
