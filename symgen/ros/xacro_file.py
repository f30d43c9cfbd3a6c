"""xacro → URDF by the package xacro, in a process of limited time and memory.

A xacro file is a program: its expressions are Python, its macros call each other. The process of
`xacro_child` lets it compute and read files of its packages, and nothing else.
"""

import json
import logging
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from symgen.errors import BuildError
from symgen.ros.packages import Packages

_PROGRAM = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from symgen.ros.xacro_child import main; main()"
)
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one expansion; the largest published robots take two seconds.

    Attributes:
        seconds: processor time [s].
        patience: time until the process is ended whatever it does [s].
        memory: address space [B].
    """

    seconds: int = 20
    patience: float = 120.0
    memory: int = 2**30


def expanded(
    path: Path, arguments: Mapping[str, str], packages: Packages, limits: Limits | None = None
) -> str:
    """Expand a xacro file.

    Args:
        path: the file.
        arguments: name → value of <xacro:arg>.
        packages: where $(find PACKAGE) searches.
        limits: of the process that expands; None: `Limits()`.

    Returns:
        Text of the URDF.

    Raises:
        BuildError: xacro is not installed, or it refuses the file (an argument is missing, a macro
            is unknown, a file is not found), or the file exceeds the limits, reads files outside of
            its packages, or has expressions that do more than compute.
    """
    if find_spec("xacro") is None:
        raise BuildError(
            f"'{path}' is a xacro file, which the package xacro expands; run: pip install xacro"
        )
    if not path.is_file():
        raise BuildError(f"cannot read the xacro file '{path}': there is no such file")
    limits = limits or Limits()
    job = {
        "path": str(path),
        "arguments": dict(arguments),
        "folders": [str(folder) for folder in packages.folders],
        "seconds": limits.seconds,
        "memory": limits.memory,
    }
    answer = _answer(path, job, limits)
    for message in answer.get("messages", ()):
        _log.warning("xacro: %s", message)
    if "text" in answer:
        return str(answer["text"])
    if "refused" in answer:
        raise BuildError(answer["refused"])
    reason = answer["reason"]
    hint = "; give it by --arg NAME=VALUE" if "ndefined substitution arg" in reason else ""
    raise BuildError(f"xacro cannot expand '{path}': {reason}{hint}")


def _answer(path: Path, job: Mapping[str, Any], limits: Limits) -> dict[str, Any]:
    """Answer of the process."""
    program = [sys.executable, "-I", "-B", "-c", _PROGRAM, json.dumps(sys.path)]
    try:
        run = subprocess.run(
            program,
            input=json.dumps(job).encode(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=limits.patience,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise BuildError(_beyond(path, f"{limits.patience:g} s")) from None
    if run.returncode == -getattr(signal, "SIGXCPU", 256):  # Windows has no such limit
        raise BuildError(_beyond(path, f"{limits.seconds} s of processor time"))
    try:
        return dict(json.loads(run.stdout))
    except ValueError:
        what = f"{limits.memory >> 20} MiB of memory"
        raise BuildError(_beyond(path, what, f" (code {run.returncode})")) from None


def _beyond(path: Path, limit: str, detail: str = "") -> str:
    return (
        f"xacro cannot expand '{path}': it takes more than {limit}{detail}; "
        "an expression or a macro may never end; correct the file"
    )
