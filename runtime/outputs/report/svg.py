"""Matplotlib figure → inline SVG that takes its colours from the page, light or dark.

Matplotlib draws in placeholder colours; each one becomes a CSS variable. Equal input gives equal
bytes: no date, salted ids, no state shared with other plots. An artist with the gid `m:NAME`
belongs to the method NAME; the filter of the page hides it with the method.
"""

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.figure import Figure

from runtime.outputs.report import style
from runtime.outputs.report.style import blank, settings

COLOURS = {
    "#010203": "var(--ink)",
    "#010204": "var(--line)",
    "#010205": "var(--measured)",
    "#010206": "var(--before)",
    "#010207": "var(--after)",
}
INK, LINE, MEASURED, BEFORE, AFTER = COLOURS
_PALETTE = {
    style.BLUE: "var(--blue)",
    style.ORANGE: "var(--orange)",
    style.GREEN: "var(--green)",
    style.PURPLE: "var(--purple)",
    style.SKY: "var(--sky)",
    style.VERMILION: "var(--vermilion)",
    style.INK: "var(--ink)",
    style.GREY: "var(--measured)",
    style.PALE: "var(--line)",
}
"""CSS variables for the colours of figures that are also saved as files."""
WIDTH = 10.0
"""Width of a figure [inch]; the page scales it."""
OWNER = "m:"
"""Prefix of the gid of an artist that belongs to a method."""
_STYLE = settings(INK, LINE, LINE) | {
    "svg.fonttype": "none",
    "grid.linewidth": 0.4,
    "lines.linewidth": 0.9,
}


@contextmanager
def page_figure(height: float) -> Iterator[Figure]:
    """Blank figure of the page width and the height [inch]."""
    with warnings.catch_warnings(), blank((WIDTH, height), _STYLE) as figure:
        # The browser has fonts that the layout engine lacks.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield figure


def svg(figure: Figure, name: str) -> Markup:
    """<svg> element with page colours, short numbers and unique ids."""
    buffer = io.StringIO()
    layout = figure.get_layout_engine()
    if layout is not None:  # once; savefig would draw everything once more for it
        layout.execute(figure)
        figure.set_layout_engine("none")
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
    for colour, variable in (COLOURS | _PALETTE).items():
        text = text.replace(f": {colour.lower()}", f": {variable}")
    text = re.sub(rf'\bid="{OWNER}([^"]*)"', r'data-m="\1"', text)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r'\sd="[^"]*"', lambda m: re.sub(r"\d+\.\d{3,}", _short, m.group()), text)
    width, height = figure.get_size_inches() * 72
    head = f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{name}">'
    return Markup(re.sub(r"<svg[^>]*>", head, text, count=1))  # noqa: S704  matplotlib escapes text


def _short(match: re.Match[str]) -> str:
    return f"{float(match.group()):.2f}"
