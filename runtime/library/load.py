"""A robot by name, or by the folder that symgen wrote."""

import os
from pathlib import Path

from runtime.errors import LibraryError
from runtime.library.library import Library


def load(
    robot: str | os.PathLike[str], level: str | None = None, threads: int | None = None
) -> Library:
    """The library of a robot by name, or by the folder that symgen wrote.

    A name is looked up in ./generated, then among the robots that come with the package. Where
    the folder holds no compiled library, its C code is compiled at the first use, which takes a
    while and is told on stderr; the library is kept in the user's cache folder ($SYMGEN_CACHE;
    $SYMGEN_LEVELS, such as v3, restricts it to some instruction sets). The
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
        package = Path(__file__).parents[1]  # generated/ lies in it if installed, else beside it
        roots = [folder / "generated" for folder in (Path.cwd(), package, package.parent)]
        found = [root / given for root in roots if (root / given / "manifest.json").exists()]
        if not found:
            raise LibraryError(
                f"no generated robot is called '{robot}' (looked in "
                f"{', '.join(str(root) for root in dict.fromkeys(roots))}); run: "
                f"python -m symgen build --urdf FILE --name {robot}, or --robot {robot} where "
                "python -m symgen list has it"
            )
        folder = found[0]
    return Library(folder, level, threads)
