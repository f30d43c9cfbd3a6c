"""A robot's name or folder → its `Library`."""

import os
from pathlib import Path

from runtime.errors import LibraryError
from runtime.library.library import Library


def load(
    robot: str | os.PathLike[str], level: str | None = None, threads: int | None = None
) -> Library:
    """The library of a robot by name, or by the folder that symgen wrote.

    A name is looked up in ./generated, then in the generated folder beside this package. The
    level is the instruction set of the batch functions, by default the best that runs here:
    v4 (AVX-512), v3 (AVX2), v2, neon, or portable; casadi is CasADi's own C, the reference.
    Batches that take milliseconds are spread over `threads`, by default as many as there are
    cores; results do not depend on their number, to the last bit.

    Raises:
        LibraryError: missing, stale, foreign or damaged; the message says what to run.
    """
    given = Path(robot)
    if given.is_dir() or given.name != str(robot):
        folder = given
    else:
        roots = [Path.cwd() / "generated", Path(__file__).parents[2] / "generated"]
        found = [root / given for root in roots if (root / given / "manifest.json").exists()]
        if not found:
            raise LibraryError(
                f"no generated robot is called '{robot}' (looked in "
                f"{' and '.join(str(root) for root in dict.fromkeys(roots))}); run: "
                f"python -m symgen build --urdf FILE --name {robot}"
            )
        folder = found[0]
    return Library(folder, level, threads)
