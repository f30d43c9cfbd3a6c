"""Code blocks of Markdown pages: read, run as a user would, and compare what they print."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import runtime.cli
import symgen.cli
import symgen.cli.console
from tests.compiling import compile_program

MAIN = {
    "symgen": symgen.cli.console.main,
    "python -m runtime": runtime.cli.main,
    "python -m symgen": symgen.cli.main,
}
"""Programs that run in this process, by the words that start them."""
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def blocks(text: str) -> Iterator[tuple[str, str]]:
    """Language and text of every fenced block."""
    yield from re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def run(language: str, block: str, capture: pytest.CaptureFixture[str]) -> str:
    """What a block prints; Python and our own commands run in this process, which knows them."""
    capture.readouterr()
    if language == "python":
        exec(compile(block, "page", "exec"), {})  # noqa: S102  our own text
        return capture.readouterr().out
    printed = ""
    for line in block.splitlines():
        words = shlex.split(line)
        if words[0] == "symgen":
            printed += run_here("symgen", words[1:], capture)
        elif words[:2] == ["python", "-m"]:
            printed += run_here(f"python -m {words[2]}", words[3:], capture)
        elif words[0] == "cc":
            compile_program(words, Path.cwd())
        else:
            done = subprocess.run(words, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{line}: {done.stderr}"
            printed += done.stdout
    return printed


def run_here(program: str, words: list[str], capture: pytest.CaptureFixture[str]) -> str:
    """What a command of ours prints; it has to end with exit code 0."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [program.rsplit(maxsplit=1)[-1], *words])
        code = None
        try:
            MAIN[program]()
        except SystemExit as end:
            code = end.code
    out, err = capture.readouterr()
    assert not code, f"{program} {' '.join(words)}: {out}{err}"
    return str(out)


def require_shown(block: str, printed: str) -> None:
    """Fail unless every line of a block of a page is among the printed ones."""
    lines = printed.splitlines()
    missing = [line for line in block.splitlines() if not any(shows(line, each) for each in lines)]
    assert not missing, "\n".join([*missing, "is not in:", printed])


def shows(line: str, printed: str) -> bool:
    """Whether a line has the words of a printed one, and its numbers to the digits shown.

    A last decimal may differ by one: other machines round otherwise. … stands for anything. A page
    shows fewer digits of what a search ends in, which differs between machines.
    """
    line, printed = (" ".join(each.split()) for each in (line, printed))
    words = [re.escape(part).replace("…", ".*") for part in NUMBER.split(line)]
    found = re.fullmatch(f"({NUMBER.pattern})".join(words), printed)
    shown = NUMBER.findall(line)
    return found is not None and all(
        abs(float(a) - float(b)) <= (a != b and "." in b) * 1.001 * last_digit(a)
        for a, b in zip(shown, found.groups(), strict=True)
    )


def last_digit(number: str) -> float:
    """One unit of the last digit of a number."""
    digits, _, power = number.partition("e")
    return float(10.0 ** (int(power or 0) - len(digits.partition(".")[2])))


def run_all(page: Path, capture: pytest.CaptureFixture[str]) -> str:
    """Run the bash and python blocks of a page in order; `text` shows what the last one prints.

    Args:
        page: Markdown.
        capture: pytest's capsys.

    Returns:
        Everything that was printed.
    """
    printed, everything = "", ""
    for language, block in blocks(page.read_text(encoding="utf-8")):
        if language in {"bash", "python"}:
            printed = run(language, block, capture)
            everything += printed
        elif language == "text":
            require_shown(block, printed)
    return everything
