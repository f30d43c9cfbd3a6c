"""Figures as PNG files without date and version: equal experiments give equal bytes."""

from pathlib import Path

from runtime.files import replacing
from runtime.outputs.report.canvas import blank, settings
from runtime.outputs.report.experiments.drawing import draw, has_figure, height
from runtime.outputs.report.experiments.reading import Experiment, SavedView

DPI = 130
_WIDTH = 10.0
"""Width of a figure [inch]."""


def write_pictures(experiments: tuple[Experiment, ...], folder: Path) -> tuple[Path, ...]:
    """Write all figures as `fig-5.1.png` and so on."""
    written = []
    for experiment, view, path in paths_of(experiments, folder):
        write_picture(experiment, view, path, (_WIDTH, height(experiment, view)), DPI)
        written.append(path)
    return tuple(written)


def paths_of(
    experiments: tuple[Experiment, ...], folder: Path
) -> tuple[tuple[Experiment, SavedView, Path], ...]:
    """Figures of the studies with their files."""
    return tuple(
        (experiment, view, folder / f"{view.id}.png")
        for experiment in experiments
        for view in filter(has_figure, experiment.views)
    )


def write_picture(
    experiment: Experiment, view: SavedView, path: Path, size: tuple[float, float], dpi: float
) -> None:
    """Write one figure."""
    with blank(size, settings(), dpi) as figure:
        draw(figure, experiment, view)
        with replacing(path) as file:
            figure.savefig(file, format="png", metadata={"Software": None})
