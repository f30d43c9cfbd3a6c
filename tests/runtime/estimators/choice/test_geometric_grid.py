"""Minimum of a function that is known on a geometric sequence."""

import numpy as np
import pytest

from runtime.estimators.choice.dry_friction import minimum_on_grid

PLACES = 0.01 * 2.0 ** np.arange(6)


@pytest.mark.parametrize("centre", [0.023, 0.04, 0.13])
def test_the_vertex_of_a_parabola_in_the_logarithm(centre: float) -> None:
    """Oracle: closed form; rounding of three squares whose difference is some hundredths."""
    at = minimum_on_grid(PLACES, 3.0 + np.log(PLACES / centre) ** 2)
    assert at == pytest.approx(centre, rel=1e-13)


@pytest.mark.parametrize(("losses", "place"), [([1, 2, 3], 0), ([3, 2, 1], 2), ([1, 1, 1], 0)])
def test_an_end_of_the_sequence_stays(losses: list[float], place: int) -> None:
    """Property: nothing is extrapolated."""
    assert minimum_on_grid(PLACES[:3], losses) == PLACES[place]
