"""Numbers in texts of options and files."""


def numbers_of(text: str) -> tuple[float, ...]:
    """Numbers separated by commas; none where a word is no number."""
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        return ()


def number_of(text: str) -> float | None:
    """The one number of a text; None where it is none."""
    numbers = numbers_of(text)
    return numbers[0] if len(numbers) == 1 else None
