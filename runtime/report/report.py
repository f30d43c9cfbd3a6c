"""Results folder → `report.html`: one file, no network, the same bytes for the same results.

`result` reads and checks, `sections` words and rounds, `figures` draws, the template only loops.
"""

from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from runtime.atomic import replacing
from runtime.report.result import Result, read_result
from runtime.report.sections import GLOSSARY, headline, sections, tiles


def write_report(folder: Path) -> Path:
    """Write `report.html` into a results folder from its `result.json` and `predictions.npz`.

    Args:
        folder: what an identification wrote.

    Returns:
        Path of the report.

    Raises:
        RuntimeFault: a file is missing or damaged, or the report cannot be written.
    """
    folder = Path(folder)
    html = _render(read_result(folder))
    path = folder / "report.html"
    with replacing(path) as file:
        file.write(html.encode("utf-8", "replace"))
    return path


def _render(result: Result) -> str:
    environment = Environment(
        loader=PackageLoader("runtime.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.jinja2").render(
        title=f"{result.robot}, {result.method}: identification report",
        subtitle=f"{result.robot} · method {result.method} · {result.recording.name}",
        headline=headline(result),
        status=result.status,
        warnings=result.warnings,
        tiles=tiles(result),
        sections=sections(result),
        glossary=GLOSSARY,
    )
