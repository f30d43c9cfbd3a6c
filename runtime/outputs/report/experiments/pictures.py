"""Figures as PNG files: the same experiments give the same bytes, no date, no version."""

from pathlib import Path

from runtime.files import replacing
from runtime.outputs.report.experiments.drawing import draw, has_figure, height
from runtime.outputs.report.experiments.reading import Experiment, SavedView
from runtime.outputs.report.style import blank, settings

DPI = 130
_WIDTH = 10.0


def write_pictures(experiments: tuple[Experiment, ...], folder: Path) -> tuple[Path, ...]:
    """`fig-5.1.png` and so on, every figure that there is.

    Raises:
        RuntimeFault: the place cannot be written.
    """
    written = []
    for experiment in experiments:
        for view in filter(has_figure, experiment.views):
            path = folder / f"{view.id}.png"
            write_picture(experiment, view, path, (_WIDTH, height(experiment, view)), DPI)
            written.append(path)
    return tuple(written)


def write_picture(
    experiment: Experiment, view: SavedView, path: Path, size: tuple[float, float], dpi: float
) -> None:
    """One figure of `size` inches."""
    with blank(size, settings(), dpi) as figure:
        draw(figure, experiment, view)
        with replacing(path) as file:
            figure.savefig(file, format="png", metadata={"Software": None})
