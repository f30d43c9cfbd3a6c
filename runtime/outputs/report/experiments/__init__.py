"""Results of experiments → page, Markdown tables, pictures, and the README's result section."""

from pathlib import Path

from runtime.files import replacing
from runtime.outputs.report.experiments.labels import short_hash
from runtime.outputs.report.experiments.page import caption, experiments_page, headline
from runtime.outputs.report.experiments.pictures import write_pictures
from runtime.outputs.report.experiments.reading import Experiment, is_experiments, read_experiments
from runtime.outputs.report.experiments.readme import write_readme
from runtime.outputs.report.experiments.tables import markdown, tables
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
    """Everything that was asked for, from a folder of finished studies; the paths written.

    Raises:
        RuntimeFault: a study is damaged, nothing is finished, or a place cannot be written.
    """
    experiments, notes = read_experiments(folder)
    written = [write_page(experiments_page(experiments, notes), out)]
    if tables_to is not None:
        with replacing(tables_to) as file:
            file.write(all_tables(experiments).encode())
        written.append(tables_to)
    if figures_to is not None:
        written += write_pictures(experiments, figures_to)
    if readme is not None:
        written += write_readme(experiments, readme, command)
    return tuple(written)


def all_tables(experiments: tuple[Experiment, ...]) -> str:
    """Every table as Markdown, with the config hash of its numbers as a footnote."""
    parts = [headline(experiments)]
    for experiment in experiments:
        parts.append(f"## {experiment.title}")
        for view in experiment.views:
            shown = [markdown(table) for table in tables(experiment, view)]
            if shown:
                parts.append(f"### {caption(view)}: {view.title} [^{experiment.name}]")
                parts += shown
    parts += [
        f"[^{e.name}]: {e.name}/result.json, config {short_hash(e)}, {e.trials} trials"
        for e in experiments
    ]
    return "\n\n".join(parts) + "\n"


__all__ = ["all_tables", "is_experiments", "read_experiments", "write_experiments"]
