"""Matplotlib settings, palette and blank figures, which share no global state."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from matplotlib import style
from matplotlib.figure import Figure

BLUE, ORANGE, GREEN = "#0072B2", "#E69F00", "#009E73"
PURPLE, SKY, VERMILION = "#CC79A7", "#56B4E9", "#D55E00"
"""Palette of Okabe and Ito, distinguishable with any colour vision."""
INK, GREY, PALE = "#222222", "#BBBBBB", "#E4E4E4"
CYCLE = (BLUE, ORANGE, GREEN, VERMILION, SKY, PURPLE, GREY)
"""Colours of lines in one panel, in order."""


def settings(ink: str = INK, line: str = GREY, grid: str = PALE) -> dict[str, Any]:
    """Matplotlib settings; names of joints are text, not mathematics."""
    return {
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans"],
        "font.size": 8,
        "text.parse_math": False,
        "text.color": ink,
        "axes.labelcolor": ink,
        "axes.edgecolor": line,
        "axes.linewidth": 0.8,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.titlesize": 8,
        "axes.titlelocation": "left",
        "axes.formatter.useoffset": False,
        "grid.color": grid,
        "grid.linewidth": 0.5,
        "xtick.color": line,
        "ytick.color": line,
        "xtick.labelcolor": ink,
        "ytick.labelcolor": ink,
        "legend.frameon": False,
        "lines.linewidth": 1.2,
    }


@contextmanager
def blank(
    size: tuple[float, float], rules: Mapping[str, Any], dpi: float = 100
) -> Iterator[Figure]:
    """Blank figure without pyplot and without the settings of the user."""
    with style.context(["default", dict(rules)]):
        yield Figure(figsize=size, layout="constrained", dpi=dpi)
