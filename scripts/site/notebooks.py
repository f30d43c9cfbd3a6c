"""Notebooks of docs/notebooks from the tutorials: the same text, every block a cell.

Commands become shell lines, files become %%writefile cells, and printed text is left out, because
running the cells prints it. `scripts/docs --notebooks` writes them; the tests execute them.
"""

import re
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

ROOT = Path(__file__).resolve().parents[2]
TUTORIALS = ROOT / "runtime" / "tutorials"
FOLDER = ROOT / "docs" / "notebooks"
NAMES = ("own-robot", "payload")
FENCE = re.compile(r"^```(\w*)\n(.*?)^```\n?", re.MULTILINE | re.DOTALL)
FILE_COMMANDS = ("symgen excite ", "symgen simulate ")
"""Commands that write files of the user's choice, not a folder of results."""
FILE = re.compile(r"[\w.]+\.(?:toml|urdf|c)\b")


def notebook(name: str) -> nbformat.NotebookNode:
    """The notebook of a tutorial."""
    text = (TUTORIALS / f"{name}.md").read_text(encoding="utf-8")
    cells, end = [], 0
    for match in FENCE.finditer(text):
        cells += _prose(text[end : match.start()])
        cells += _code(*match.groups())
        end = match.end()
    cells += _prose(text[end:])
    for k, cell in enumerate(cells):
        cell["id"] = f"{name}-{k}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return new_notebook(cells=cells, metadata={"kernelspec": kernel})


def _prose(text: str) -> list[nbformat.NotebookNode]:
    return [new_markdown_cell(text.strip())] if text.strip() else []


def _code(language: str, block: str) -> list[nbformat.NotebookNode]:
    if language == "python":
        return [new_code_cell(block.rstrip())]
    if language == "bash":
        return [new_code_cell("\n".join(f"!{_again(line)}" for line in block.splitlines()))]
    if language == "text":
        return []
    return [new_code_cell(f"%%writefile {FILE.findall(block)[0]}\n{block.rstrip()}")]


def _again(line: str) -> str:
    """A command that may replace its files, because cells are run again."""
    return f"{line} --overwrite" if line.startswith(FILE_COMMANDS) else line


def text_of(name: str) -> str:
    """The notebook as it is stored."""
    return str(nbformat.writes(notebook(name))) + "\n"


def main() -> None:
    """Write every notebook."""
    for name in NAMES:
        path = FOLDER / f"{name}.ipynb"
        path.write_text(text_of(name), encoding="utf-8")
        print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
