"""Results folder → `report.html`: one file, no network, the same bytes for the same results.

`result` reads and checks, `sections` words and rounds, `figures` draws, the template only loops.
A comparison of methods in the folder is shown too, as the page itself where there is nothing else.
"""

from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from runtime.atomic import replacing
from runtime.report.comparison import method_sections, page, read_methods
from runtime.report.result import Result, read_result
from runtime.report.sections import GLOSSARY, headline, sections, tiles


def write_report(folder: Path) -> Path:
    """Write `report.html` into a results folder from the files in it.

    Args:
        folder: what an identification wrote (`result.json` and `predictions.npz`), or a
            comparison (`compare.json`), or both.

    Returns:
        Path of the report.

    Raises:
        RuntimeFault: a file is missing or damaged, or the report cannot be written.
    """
    folder = Path(folder)
    methods = read_methods(folder)
    if methods is not None and not (folder / "result.json").exists():
        shown = page(methods)
    else:
        shown = _page(read_result(folder))
        if methods is not None:
            shown["sections"] += method_sections(methods)
    html = _render(shown)
    path = folder / "report.html"
    with replacing(path) as file:
        file.write(html.encode("utf-8", "replace"))
    return path


def _page(result: Result) -> dict[str, Any]:
    return {
        "title": f"{result.robot}, {result.method}: identification report",
        "subtitle": f"{result.robot} · method {result.method} · {result.recording.name}",
        "headline": headline(result),
        "status": result.status,
        "warnings": result.warnings,
        "tiles": tiles(result),
        "sections": sections(result),
        "glossary": GLOSSARY,
    }


def _render(shown: dict[str, Any]) -> str:
    environment = Environment(
        loader=PackageLoader("runtime.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html.jinja2").render(**shown)
