"""Numbers in texts."""

import math

import pytest

from runtime.common.texts import number_of, numbers_of


@pytest.mark.parametrize(
    ("text", "numbers"),
    [("1,-2.5, 3e2", (1.0, -2.5, 300.0)), ("7", (7.0,)), ("", ()), ("1,,2", ()), ("1,a", ())],
)
def test_numbers_stand_between_commas(text: str, numbers: tuple[float, ...]) -> None:
    """Oracle: the numbers as written; none where one word is no number."""
    assert numbers_of(text) == numbers


@pytest.mark.parametrize(("text", "number"), [("-1.5", -1.5), ("auto", None), ("1,2", None)])
def test_one_number_is_the_whole_text(text: str, number: float | None) -> None:
    """Oracle: the number as written; None for words and for several numbers."""
    assert number_of(text) == number


def test_what_is_written_as_no_number_is_one() -> None:
    """Property: nan is a number of a text, which its option refuses by its range."""
    assert math.isnan(number_of("nan") or 0.0)
