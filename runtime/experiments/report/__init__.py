"""Results of experiments → HTML page, Markdown tables, figures, a section of a Markdown page."""

from pathlib import Path

from runtime.common.files import write_text
from runtime.experiments.report.drawing import paths_of, write_pictures
from runtime.experiments.report.labels import tables
from runtime.experiments.report.page import caption, experiments_page, headline, write_readme
from runtime.experiments.report.reading import Experiment, is_experiments, read_experiments
from runtime.outputs.report import ReportKind
from runtime.outputs.report.page import write_page


def write_experiments(
    folder: Path,
    out: Path,
    *,
    tables_to: Path | None = None,
    figures_to: Path | None = None,
    readme: Path | None = None,
    command: str = "",
) -> tuple[Path, ...]:
    """Write the page and the requested tables and figures of a folder of finished studies."""
    experiments, notes = read_experiments(folder)
    written = [write_page(experiments_page(experiments, notes), out)]
    if tables_to is not None:
        write_text(tables_to, all_tables(experiments))
        written.append(tables_to)
    if figures_to is not None:
        written += write_pictures(experiments, figures_to)
    if readme is not None:
        written += write_readme(experiments, readme, command)
    return tuple(written)


def picture_paths(folder: Path, figures_to: Path) -> tuple[Path, ...]:
    """Files that `write_experiments` writes into the folder of figures."""
    return tuple(path for _, _, path in paths_of(read_experiments(folder)[0], figures_to))


def all_tables(experiments: tuple[Experiment, ...]) -> str:
    """All tables as Markdown, with the config hash of their numbers as footnotes."""
    parts = [headline(experiments)]
    for experiment in experiments:
        parts.append(f"## {experiment.title}")
        for view in experiment.views:
            shown = [table.markdown() for table in tables(experiment, view)]
            if shown:
                parts.append(f"### {caption(view)}: {view.title} [^{experiment.name}]")
                parts += shown
    for e in experiments:
        parts.append(f"[^{e.name}]: {e.name}/result.json, config {e.short_hash}, {e.trials} trials")
    return "\n\n".join(parts) + "\n"


EXPERIMENTS = ReportKind("experiments", is_experiments, picture_paths, write_experiments)
