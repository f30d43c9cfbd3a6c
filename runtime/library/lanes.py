"""Tiles of the generated C: rows of `LANES` samples, at every instruction set."""

LANES = 8


def padded_size(size: int) -> int:
    """The least multiple of `LANES` that holds `size`."""
    return -(-size // LANES) * LANES
