"""Notebooks of docs/notebooks from the tutorials by jupytext: the same text, every block a cell.

Commands become shell lines, files become %%writefile cells, and printed text is left out, because
running the cells prints it. `scripts/docs --notebooks` writes them; the tests execute them.
"""

import re
from pathlib import Path

import jupytext
import nbformat

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "notebooks"
NAMES = ("own-robot", "payload")
FENCE = re.compile(r"^```(\w*)\n(.*?)^```\n?", re.MULTILINE | re.DOTALL)
FILE_COMMANDS = ("symgen excite ", "symgen simulate ")
"""Commands that write files of the user's choice: a cell that runs again replaces them."""
FILE = re.compile(r"[\w.]+\.(?:toml|urdf|c)\b")


def _code(match: re.Match[str]) -> str:
    """A block of a tutorial as a block of Python with the magic words of Jupyter."""
    language, block = match.groups()
    if language == "text":
        return ""
    if language == "bash":
        block = "".join(f"!{_again(line)}\n" for line in block.splitlines())
    elif language != "python":
        block = f"%%writefile {FILE.findall(block)[0]}\n{block}"
    return f"```python\n{block}```\n"


def _again(line: str) -> str:
    """A command that may run twice in one folder."""
    if line.startswith("symgen excite"):  # whose option it is not
        return f"{line} --settings overwrite=true"
    return line + " --overwrite" * line.startswith(FILE_COMMANDS)


def text_of(name: str) -> str:
    """The notebook of a tutorial as it is stored, without outputs."""
    text = (ROOT / "runtime" / "tutorials" / f"{name}.md").read_text(encoding="utf-8")
    notebook = jupytext.reads(FENCE.sub(_code, text), fmt="md")
    for k, cell in enumerate(notebook.cells):
        cell["id"], cell["metadata"] = f"{name}-{k}", {}
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook.metadata = {"kernelspec": kernel}
    return str(nbformat.writes(notebook)) + "\n"


def main() -> None:
    """Write every notebook."""
    for name in NAMES:
        path = FOLDER / f"{name}.ipynb"
        path.write_text(text_of(name), encoding="utf-8")
        print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
