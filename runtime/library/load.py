"""A robot by name, or by the folder that symgen wrote."""

import os
from pathlib import Path

from runtime.errors import LibraryError
from runtime.library.library import Library


def load(
    robot: str | os.PathLike[str], level: str | None = None, threads: int | None = None
) -> Library:
    """Library of a robot by name, or by the folder that symgen wrote.

    A name is looked up in ./generated, then among the robots that come with the package. Where the
    folder holds no compiled library, its C code is compiled at the first use; a line on stderr says
    so. The library is kept in the user's cache folder ($SYMGEN_CACHE).

    Args:
        robot: name, or path of a generated folder.
        level: instruction set of the batch functions, by default the best that runs here: v4
            (AVX-512), v3 (AVX2), v2, neon or portable; casadi is CasADi's C, the reference.
            $SYMGEN_LEVELS restricts which are compiled.
        threads: number of threads for batches that take milliseconds; by default one per core.
            Results do not depend on it, to the last bit.

    Returns:
        The robot's kernels as NumPy methods.

    Raises:
        LibraryError: missing, stale, foreign or damaged; the message states the command to run.
    """
    given = Path(robot)
    if given.is_dir() or given.name != str(robot):
        folder = given
    else:
        package = Path(__file__).parents[1]  # generated/ lies in it if installed, else beside it
        roots = [folder / "generated" for folder in (Path.cwd(), package, package.parent)]
        present = [root / given for root in roots if (root / given / "manifest.json").exists()]
        if not present:
            bundled = (package.parent / "symgen" / "robots" / f"{robot}.urdf").exists()
            options = f"--robot {robot}" if bundled else f"--urdf FILE --name {robot}"
            raise LibraryError(
                f"no generated robot is called '{robot}' (looked in "
                f"{', '.join(str(root) for root in dict.fromkeys(roots))}); run: "
                f"python -m symgen build {options}"
            )
        folder = present[0]
    return Library(folder, level, threads)
