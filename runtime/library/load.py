"""A robot by name, or by the folder that symgen wrote."""

import os

from runtime.library.find import find
from runtime.library.library import Library


def load(
    robot: str | os.PathLike[str], level: str | None = None, threads: int | None = None
) -> Library:
    """Library of a robot by name, or by the folder that symgen wrote.

    A name, [a-z][a-z0-9_]*, is looked up among the robots that come with the package, then among
    those that you have built. A folder is loaded by its path, which contains a slash or is a Path:
    its code runs in this process. A compiled library that you did not build is never opened; the C
    code of its folder is compiled instead, as where there is no library, at the first use; a line
    on stderr says so. The library is kept in the user's cache folder ($SYMGEN_CACHE).

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
    return Library(find(robot).folder, level, threads)
