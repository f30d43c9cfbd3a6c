"""Command lines of C compilers, source by source: a compiler cache knows no others."""

import subprocess
from collections.abc import Sequence
from pathlib import Path

SOURCES = (".c", ".cpp")


def compile_program(words: Sequence[object], folder: Path) -> None:
    """Do what `cc FLAGS SOURCES -o PROGRAM LIBRARIES` does, in a folder; fail with its complaint.

    There absolute names are the same in every run: a cache takes them relative to it.
    """
    compiler, *rest = map(str, words)
    place = rest.index("-o")
    output, rest = rest[place : place + 2], rest[:place] + rest[place + 2 :]
    flags = [word for word in rest if word[0] == "-" and word[:2] != "-l" and word[:4] != "-Wl,"]
    for k, word in enumerate(rest):
        if word.endswith(SOURCES):
            rest[k] = f"{Path(word).stem}_{k}.o"
            _run([compiler, *flags, "-c", word, "-o", rest[k]], folder)
    _run([compiler, *rest, *output], folder)


def _run(words: Sequence[str], folder: Path) -> None:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(words)}: {done.stderr}"
