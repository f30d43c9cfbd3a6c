"""The one place of matplotlib: blank figures, palette, inline SVG, curves thinned to a screen.

Figures share no state with other plots and no settings of the user; equal input gives equal bytes.
A figure of a page is drawn in placeholder colours; each becomes a CSS variable of the page, light
or dark. An artist with the gid `m:NAME` belongs to the method NAME, with which the page hides it.
"""

import io
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from markupsafe import Markup

from runtime.common.files import replacing
from runtime.errors import RecordingError
from runtime.library import Array, Indices

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN = "#0072B2", "#E69F00", "#009E73"
PURPLE, SKY, VERMILION = "#CC79A7", "#56B4E9", "#D55E00"  # Okabe and Ito, for any colour vision
INK, GREY, PALE = "#222222", "#BBBBBB", "#E4E4E4"
CYCLE = (BLUE, ORANGE, GREEN, VERMILION, SKY, PURPLE, GREY)  # colours of lines of a panel, in order

PAGE_INK, PAGE_LINE = "#010203", "#010204"
MEASURED, BEFORE, AFTER = "#010205", "#010206", "#010207"  # placeholder colours of a page's figures
_VARIABLES = {  # CSS variables for colours of pages and of figures that are also saved as files
    PAGE_INK: "ink",
    PAGE_LINE: "line",
    MEASURED: "measured",
    BEFORE: "before",
    AFTER: "after",
    BLUE: "blue",
    ORANGE: "orange",
    GREEN: "green",
    PURPLE: "purple",
    SKY: "sky",
    VERMILION: "vermilion",
    INK: "ink",
    GREY: "measured",
    PALE: "line",
}
FORMATS = ("png", "pdf", "svg")
POINTS = 4000  # largest number of points of one curve of a file
WIDTH = 10.0  # width of a figure of a page [inch]; the page scales it
OWNER = "m:"  # prefix of the gid of an artist that belongs to a method


def settings(ink: str = INK, line: str = GREY, grid: str = PALE) -> dict[str, Any]:
    """Settings of matplotlib by colours; names of joints are text, not mathematics."""
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
        "axes.titley": 1.0,  # else each draw measures every tick label for it
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
    size: tuple[float, float],
    rules: Mapping[str, Any],
    dpi: float = 100,
    layout: Literal["constrained"] | None = "constrained",
) -> "Iterator[Figure]":
    """Blank figure of a size [inch] without pyplot and without the settings of the user."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(["default", dict(rules)]):
        yield Figure(figsize=size, layout=layout, dpi=dpi)


@contextmanager
def page_figure(
    height: float, layout: Literal["constrained"] | None = "constrained"
) -> "Iterator[Figure]":
    """Blank figure of the page width and the height [inch], with the settings in force."""
    rules = settings(PAGE_INK, PAGE_LINE, PAGE_LINE) | {
        "svg.fonttype": "none",
        "grid.linewidth": 0.4,
        "lines.linewidth": 0.9,
    }
    with warnings.catch_warnings(), blank((WIDTH, height), rules, layout=layout) as figure:
        # The browser has fonts that the layout engine lacks.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield figure


def picture_format(path: Path) -> str:
    """Image format of a file name: png, pdf or svg."""
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in FORMATS:
        raise RecordingError(
            f"expected an image file with the suffix .{', .'.join(FORMATS)}, got '{path.name}'; "
            "rename it"
        )
    return suffix


@contextmanager
def picture(path: Path, size: tuple[float, float], dpi: float) -> "Iterator[Figure]":
    """Blank figure that is written to a file, complete or not at all."""
    suffix = picture_format(path)
    with blank(size, settings(), dpi) as figure:
        yield figure
        if suffix == "png":  # the others are laid out once more, at 72 dots per inch
            arrange(figure)
        with replacing(path) as file:  # without the version of matplotlib
            metadata = {"Software": None} if suffix == "png" else None
            figure.savefig(file, format=suffix, metadata=metadata)


def arrange(figure: "Figure") -> None:
    """Place the axes once; savefig would draw everything once more for it."""
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
        figure.set_layout_engine(None)


def heading(figure: "Figure", text: str) -> None:
    """Write one or several lines above all panels of a picture."""
    figure.suptitle(text, fontsize=9, x=0.01, ha="left")


def svg(figure: "Figure", name: str) -> Markup:
    """<svg> element with page colours, short numbers and unique ids."""
    from matplotlib import rc_context

    buffer = io.StringIO()
    arrange(figure)
    with rc_context({"svg.hashsalt": name}):
        figure.savefig(
            buffer,
            format="svg",
            transparent=True,
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
        )
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    for colour, variable in _VARIABLES.items():
        text = text.replace(f": {colour.lower()}", f": var(--{variable})")
    text = re.sub(rf'\bid="{OWNER}([^"]*)"', r'data-m="\1"', text)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r'\sd="[^"]*"', lambda m: re.sub(r"(?<=\.\d\d)\d+", "", m.group()), text)
    width, height = figure.get_size_inches() * 72
    head = f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{name}">'
    return Markup(re.sub(r"<svg[^>]*>", head, text, count=1))  # noqa: S704  matplotlib escapes text


def pauses(t: Array) -> Indices:
    """Indices of the first samples after pauses of more than ten median steps."""
    steps = np.diff(t)
    step = np.median(steps) if len(t) > 1 else 0.0
    return np.flatnonzero(steps > 10 * step) + 1


def thinned(t: Array, y: Array, most: int, gaps: Indices | None = None) -> tuple[Array, Array]:
    """Reduce a curve to about `most` points: the smallest and largest value of equal bins.

    A pause becomes a gap in the line, unless there are too many.
    """
    if gaps is None:
        gaps = pauses(t)
    if len(gaps) > most // 20:
        gaps = gaps[:0]
    pieces_t, pieces_y = [], []
    edges = [0, *gaps, len(t)]
    for start, stop in pairwise(edges):
        kept = start + _envelope(y[start:stop], max(2, most * (stop - start) // len(t)))
        pieces_t += [t[kept], [np.nan]]
        pieces_y += [y[kept], [np.nan]]
    return np.concatenate(pieces_t[:-1]), np.concatenate(pieces_y[:-1])


def _envelope(y: Array, most: int) -> Indices:
    """Indices of the first, the last, and the smallest and largest value of each bin."""
    count = len(y)
    if count <= most:
        return np.arange(count)
    safe = np.nan_to_num(y)
    bins = max(1, most // 2)
    size = count // bins
    # Rows of equal length; the remainder, shorter than one more row per bin, forms bins as well.
    whole = count // size * size
    rows = safe[:whole].reshape(-1, size)
    first = np.arange(0, whole, size)
    kept = [first + rows.argmin(axis=1), first + rows.argmax(axis=1), np.array([0, count - 1])]
    if whole < count:
        rest = safe[whole:]
        kept.append(whole + np.array([rest.argmin(), rest.argmax()]))
    return np.unique(np.concatenate(kept))
