"""runtime.identification.comparison.output: every rule is seen to speak and to be silent."""

from dataclasses import replace

import numpy as np
import pytest

from runtime.identification.comparison.output import Advice, advise, better_beyond_chance
from runtime.identification.comparison.run import FAILED, NOT_RUN, RAN, Figures, MethodRow

RNG = np.random.default_rng(0)
NOISE = RNG.chisquare(7, 400)
"""Squared errors of 400 validation samples of seven joints."""


def figures(percent: float = 1.4, **changes: object) -> Figures:
    """Of a consistent answer in the interior, whose squares go with its error."""
    base = Figures(
        train_percent=1.3,
        validation_percent=percent,
        test_percent=percent,
        rms=np.full(7, percent / 10),
        squares=NOISE * percent**2,
        base_error_percent=None,
        seconds=0.01,
        iterations=3,
        smallest_relative_eigenvalue=1e-4,
        consistent=True,
        boundary=False,
        gap_to_convex_optimum=0.1,
        excited=43,
        determined=40,
    )
    return replace(base, **changes)  # type: ignore[arg-type]


def ran(method: str, percent: float = 1.4, **changes: object) -> MethodRow:
    return MethodRow(method, RAN, "a status", figures(percent, **changes))


def advice_on(*rows: MethodRow) -> Advice:
    return advise(rows, 43)


def says(advice: Advice, words: str) -> bool:
    return any(words in sentence for sentence in advice.sentences)


def test_the_default_is_taken() -> None:
    """Property: MAP, unless a consistent answer off the boundary is better beyond chance."""
    plain = advice_on(ran("map"), ran("adam", 1.39), ran("pc-ols", 1.41))
    assert plain.take == "map"
    assert plain.sentences[0].startswith("Take map: the default;")
    assert says(plain, "Every result is physically consistent")
    better = advice_on(ran("map"), ran("adam", 1.2))
    assert better.take == "adam"
    assert (
        "its validation error, 1.2 %, is significantly below the 1.4 % of map"
        in better.sentences[0]
    )
    nets = advice_on(ran("map"), ran("nn", 1.2), ran("adam", 1.39))
    assert nets.take == "nn"
    assert "--friction auto" in nets.sentences[0]
    edge = advice_on(ran("map"), ran("adam", 1.2, boundary=True))
    assert edge.take == "map"
    assert "no other consistent result off the boundary of consistency" in edge.sentences[0]
    assert says(edge, "so that adam had no share in the choice, although adam predicts")
    assert says(edge, "(1.2 % against 1.4 % of map on the validation part)")
    alone = advice_on(ran("adam"), ran("pc-ols", 1.2, boundary=True))
    assert "of all results off the boundary of consistency (map has none)" in alone.sentences[0]
    assert says(alone, "although pc-ols predicts significantly better")
    # The same mean, but all of the gain in one block: chance.
    lucky = NOISE * 1.4**2
    lucky[:40] *= 0.1
    assert advice_on(ran("map"), ran("adam", 1.2, squares=lucky)).take == "map"


def test_the_test_part_has_no_share_in_the_choice() -> None:
    """Property: a method that is best on the test part alone is not taken, and no other reason
    names it.
    """
    lucky = advice_on(ran("map"), ran("adam", test_percent=0.1))
    assert lucky.take == "map"
    worse = advice_on(ran("map"), ran("adam", 1.2, test_percent=9.0))
    assert worse.take == "adam"


def test_without_the_default() -> None:
    """Property: the best consistent answer off the boundary; none at all without one."""
    others = advice_on(
        ran("adam", 1.2, boundary=True), ran("lm", 1.5), ran("ols", 1.0, consistent=False)
    )
    assert others.take == "lm"
    assert "(map has none)" in others.sentences[0]
    assert advice_on(ran("adam", boundary=True)).take == "adam"
    impossible = advice_on(ran("ols", 1.0, consistent=False), ran("map", 1.2, consistent=False))
    assert impossible.take is None
    assert impossible.sentences == (
        "No method that ran is physically consistent (ols, map); ols predicts torques best, but "
        "use none of them in a simulator or a controller: run map",
    )
    nothing = advice_on(MethodRow("map", FAILED, "too bad"), MethodRow("iv", NOT_RUN, "no loop"))
    assert nothing.take is None
    assert says(nothing, "No method has a result")


def test_what_inconsistency_buys() -> None:
    """Property: the best inconsistent answer is named, and compared by a t-test, not by digits."""
    better = advice_on(ran("map"), ran("ols", 1.2, consistent=False))
    assert says(better, "Physically consistent: map; not consistent: ols")
    assert says(better, "ols, predicts significantly better (1.2 % against 1.4 % on the")
    same = advice_on(ran("map"), ran("ols", 1.395, consistent=False))
    assert says(same, "Inconsistency brings no gain: ols")
    consistent = advice_on(ran("map"), ran("ols", 1.2))
    assert not says(consistent, "nconsistent")


def test_the_boundary_is_reported() -> None:
    """Property: answers at the edge are named."""
    edge = advice_on(ran("map"), ran("pc-ols", boundary=True), ran("lm"))
    assert says(edge, "On the boundary of consistency: pc-ols;")
    assert not says(advice_on(ran("map"), ran("pc-ols")), "boundary")


def test_what_the_prior_tells() -> None:
    """Property: the motion's silence, the prior's dominance, and neither."""
    assert says(advice_on(ran("map", excited=40)), "excites 40 of 43 base parameters")
    weak = advice_on(ran("map", determined=21))
    assert says(weak, "The data determine 21 of 43 independent combinations")
    assert says(weak, "the data contain little information")
    strong = advice_on(ran("map", determined=22))
    assert says(strong, "The data determine 22 of 43 independent combinations")
    assert not says(strong, "the data contain little information")


def test_over_fitting() -> None:
    """Property: OLS is compared by its growth from train to test against the chosen answer's."""
    bad = advice_on(ran("map", 1.4), ran("ols", 1.4, train_percent=1.1))
    assert says(bad, "over-fits: the error of ols grows from 1.1 to 1.4 % between training")
    good = advice_on(ran("map", 1.4), ran("ols", 1.4, train_percent=1.25))
    assert says(good, "does not over-fit")
    assert not says(advice_on(ran("map"), ran("wls")), "over-fit")


def test_the_truth_where_it_is_known() -> None:
    """Property: the nearest base parameters, and those of the chosen one beside them."""
    both = advice_on(ran("map", base_error_percent=0.5), ran("ols", base_error_percent=0.3))
    assert says(both, "base parameters of ols have the smallest error, 0.3 %, those of map 0.5 %")
    single = advice_on(ran("map", base_error_percent=0.2), ran("ols", base_error_percent=0.3))
    assert says(single, "base parameters of map have the smallest error, 0.2 %")
    assert not says(advice_on(ran("map")), "true parameters")


def test_the_absent_are_named() -> None:
    """Property: what lacks something and what failed, apart."""
    advice = advice_on(
        ran("map"), MethodRow("iv", NOT_RUN, "no loop"), MethodRow("ekf", FAILED, "diverged")
    )
    assert advice.sentences[-1] == "Not run: iv; failed: ekf, each for the reason in its row"
    assert not says(advice_on(ran("map")), "reason in its row")


def test_chance() -> None:
    """Oracle: of equal errors, correlated over 20 samples, 5 % differ by a two-sided test at 95 %.

    One side is requested, so 2.5 %; t over every sample alone would find 30 %.
    """
    rng = np.random.default_rng(1)
    kernel = np.ones(20) / 20
    result = 0
    for _ in range(400):
        a, b = (np.convolve(rng.normal(size=1019), kernel, "valid") ** 2 for _ in range(2))
        result += better_beyond_chance(a, b)
    # 400 draws of 2.5 %: 10 ± 3.1; blocks of 100 samples are not quite independent.
    assert 2 <= result <= 20
    assert better_beyond_chance(np.ones(100), np.full(100, 2.0))
    assert not better_beyond_chance(np.ones(100), np.ones(100))
    assert not better_beyond_chance(np.zeros(5), np.ones(5))
    with pytest.raises(ValueError, match="operands"):
        better_beyond_chance(np.zeros(50), np.ones(60))
