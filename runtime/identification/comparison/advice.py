"""Which method to trust, by rule, in plain sentences.

MAP is taken unless it has no consistent answer, or another strictly consistent method predicts the
test part better beyond chance. Chance is judged on contiguous blocks of the test part, whose means
are nearly independent although neighbouring residuals are not: t = mean(d)/(std(d)/√B) of the
block means of d, the difference of squared errors. Source: Diebold & Mariano 1995 for testing d;
Law & Kelton for means of batches.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from runtime.estimators.methods import DEFAULT, METHODS
from runtime.identification.comparison.row import NOT_RUN, RAN, Figures, Row
from runtime.library import Array

UNCONSTRAINED = "ols"
"""Method whose growth of the error from training to test shows over-fitting."""
BLOCKS = 10
LEVEL = 0.95
WORTHWHILE = 0.01
"""Relative gain in torque error below which a better method is not worth a word."""
ENOUGH = 0.5
"""Share of the base parameters below which the data count as dominated by the prior."""
OVERFIT = 1.1
"""How much more than that of the chosen method the error of OLS may grow from train to test."""


@dataclass(frozen=True, slots=True)
class Advice:
    """What to take (None: nothing can be taken), and the sentences that say why."""

    take: str | None
    sentences: tuple[str, ...]


def advise(rows: Sequence[Row], n_base: int) -> Advice:
    """Advice on the rows of one comparison.

    Args:
        rows: of any methods, in any order.
        n_base: base parameters of the robot.
    """
    ran = {row.method: row.figures for row in rows if row.figures is not None}
    if not ran:
        why = "no method has an answer on these data; the reason of each is in its row"
        return Advice(None, (_capital(why),))
    sound = {name: f for name, f in ran.items() if f.is_consistent}
    if not sound:
        best = _best(ran)
        return Advice(
            None,
            (
                f"No method that ran is physically consistent ({', '.join(ran)}); {best} predicts "
                "torques best, but take none of them for a simulator or a controller: run map",
            ),
        )
    take, why = _choice(sound)
    sentences = [
        f"take {take}: {why}",
        _consistency(ran),
        _inconsistent(ran, take),
        _boundary(sound),
        _prior(ran[take], take, n_base),
        _overfit(ran, take),
        _truth(ran, take),
        _absent(rows),
    ]
    return Advice(take, tuple(_capital(sentence) for sentence in sentences if sentence))


def better_beyond_chance(a: Array, b: Array) -> bool:
    """Whether squared errors a are smaller than b, (N,) each, by two-sided t at `LEVEL`."""
    count = min(BLOCKS, len(a) // 2)
    if count < 3:
        return False
    means = np.array([part.mean() for part in np.array_split(b - a, count)])
    spread = float(means.std(ddof=1)) / np.sqrt(count)
    if spread == 0:
        return bool(means.mean() > 0)
    return bool(means.mean() / spread > student.ppf((1 + LEVEL) / 2, count - 1))


def _choice(sound: dict[str, Figures]) -> tuple[str, str]:
    inside = {name: f for name, f in sound.items() if not f.is_boundary}
    if DEFAULT not in sound:
        take = _best(inside or sound)
        return take, f"the best prediction of the consistent answers there are ({DEFAULT} has none)"
    rivals = {
        name: f for name, f in inside.items() if name != DEFAULT and _beats(f, sound[DEFAULT])
    }
    if not rivals:
        return DEFAULT, (
            "the default; its links can exist, it knows its own uncertainty, and no other "
            "consistent answer predicts better beyond chance"
        )
    take = _best(rivals)
    told = (
        f"its links can exist and its test error, {_percent(sound[take])}, is below the "
        f"{_percent(sound[DEFAULT])} of {DEFAULT} beyond chance"
    )
    if more := METHODS[take].when_recommended:
        told += f"; {more}"
    return take, told


def _consistency(ran: dict[str, Figures]) -> str:
    bad = [name for name, f in ran.items() if not f.is_consistent]
    if not bad:
        return "every answer is physically consistent"
    return (
        f"physically consistent are {', '.join(n for n in ran if n not in bad)}; not so "
        f"{', '.join(bad)}, whose links no simulator should be given"
    )


def _inconsistent(ran: dict[str, Figures], take: str) -> str:
    bad = {name: f for name, f in ran.items() if not f.is_consistent}
    if not bad:
        return ""
    best = _best(bad)
    figures = f"{_percent(bad[best])} against {_percent(ran[take])}"
    if _beats(bad[best], ran[take]):
        return (
            f"the best inconsistent answer, {best}, predicts better beyond chance ({figures}): "
            "either its freedom stands in for effects the model lacks, mostly friction, or the "
            "URDF misleads as a prior; use it for torques of similar motions at most"
        )
    return (
        f"being inconsistent buys nothing: {best}, the best of those, does not predict better "
        f"beyond chance ({figures})"
    )


def _boundary(sound: dict[str, Figures]) -> str:
    edge = [name for name, f in sound.items() if f.is_boundary]
    if not edge:
        return ""
    return (
        f"on the boundary of consistency: {', '.join(edge)}; a link there is a plate or a rod, a "
        "corner of what is possible rather than a measurement"
    )


def _prior(f: Figures, take: str, n_base: int) -> str:
    if f.excited < n_base:
        return (
            f"the motion excites {f.excited} of {n_base} base parameters, the others are the "
            "URDF's; record a motion that moves every joint (excite designs one)"
        )
    told = f"the data tell {f.determined} of {n_base} independent combinations of parameters"
    if f.determined < ENOUGH * n_base:
        return (
            f"{told}, the prior tells the rest: {take} is close to the URDF because little speaks "
            "against it, so record a longer or faster motion, or model friction better"
        )
    return f"{told}, the prior tells the rest"


def _overfit(ran: dict[str, Figures], take: str) -> str:
    if UNCONSTRAINED not in ran or take == UNCONSTRAINED:
        return ""
    free = ran[UNCONSTRAINED]
    told = (
        f"from {free.train_percent:.3g} to {_percent(free)} between training and test, "
        f"that of {take} from {ran[take].train_percent:.3g} to {_percent(ran[take])}"
    )
    if _growth(free) > OVERFIT * _growth(ran[take]):
        return f"unconstrained least squares over-fits: the error of {UNCONSTRAINED} grows {told}"
    return f"least squares does not over-fit: the error of {UNCONSTRAINED} goes {told}"


def _truth(ran: dict[str, Figures], take: str) -> str:
    errors = {name: f.base_error for name, f in ran.items() if f.base_error is not None}
    if not errors:
        return ""
    best = min(errors, key=lambda name: errors[name])
    told = f"the truth is known: base parameters of {best} are nearest, {errors[best]:.3g} % off"
    return told if best == take else f"{told}, those of {take} {errors[take]:.3g} %"


def _absent(rows: Sequence[Row]) -> str:
    missing = [row.method for row in rows if row.outcome == NOT_RUN]
    failed = [row.method for row in rows if row.outcome not in {NOT_RUN, RAN}]
    parts = [f"not run: {', '.join(missing)}"] if missing else []
    parts += [f"failed: {', '.join(failed)}"] if failed else []
    return f"{'; '.join(parts)}, each for the reason in its row" if parts else ""


def _beats(a: Figures, b: Figures) -> bool:
    """Worth a word and beyond chance."""
    worth = a.test_percent < (1 - WORTHWHILE) * b.test_percent
    return worth and better_beyond_chance(a.squares, b.squares)


def _best(ran: dict[str, Figures]) -> str:
    return min(ran, key=lambda name: ran[name].test_percent)


def _growth(f: Figures) -> float:
    return f.test_percent / max(f.train_percent, 1e-300)


def _percent(f: Figures) -> str:
    return f"{f.test_percent:.3g} %"


def _capital(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]
