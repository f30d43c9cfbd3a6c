"""Writer of a comparison: compare.json for programs, compare.md for people.

Only the times differ between runs on the same data.
"""

import html
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from runtime.common.files import replacing
from runtime.identification.comparison.advice import Advice, advise
from runtime.identification.comparison.row import HEAD, cells, finite, row_facts
from runtime.identification.comparison.run import Comparison
from runtime.identification.problem_setup import PARTS
from runtime.identification.result_file import versions
from runtime.library.manifest import file_units
from runtime.recording import Recording

FORMAT = 1


def write_comparison(
    comparison: Comparison,
    folder: Path,
    command: str,
    options: Mapping[str, Any],
    notes: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Write compare.json and compare.md."""
    lib = comparison.assembly.problem.lib
    advice = advise(comparison.rows, len(lib.base_columns))
    facts = _facts(comparison, advice, command, options, notes)
    text = json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    with replacing(folder / "compare.json") as file:
        file.write(text.encode())
    with replacing(folder / "compare.md") as file:
        file.write(_markdown(facts).encode())
    return facts


def _facts(
    comparison: Comparison,
    advice: Advice,
    command: str,
    options: Mapping[str, Any],
    notes: tuple[str, ...],
) -> dict[str, Any]:
    assembly, truth = comparison.assembly, comparison.truth
    lib = assembly.problem.lib
    parts = {name: _extent(assembly.recordings(name)) for name in PARTS}
    train = assembly.parts[0]
    one_run = (
        "training and test are parts of one run, which underestimates the error of every method",
    )
    return {
        "format": FORMAT,
        "robot": lib.name,
        "joints": list(lib.joint_names),
        "units": file_units(lib.manifest),
        "recording": {
            "name": train.name.removesuffix("/train"),
            "samples": {name: count for name, (count, *_) in parts.items()},
            "spans": {name: span for name, (_, *span) in parts.items()},
            "history": list(train.history),
        },
        "friction": assembly.friction.facts(),
        "weights": assembly.problem.weights.tolist(),
        "before_percent": comparison.before,
        "convex_optimum": finite(comparison.optimum),
        "rows": [row_facts(row) for row in comparison.rows],
        "advice": {"take": advice.take, "sentences": list(advice.sentences)},
        "notes": [*notes, *(one_run if assembly.one_run else ())],
        "provenance": {
            "command": command,
            "options": dict(options),
            "versions": versions() | lib.manifest.versions,
            "files": dict(train.source) | ({truth.name: truth.sha256} if truth else {}),
            "model_hash": lib.manifest.model_hash,
            "seed": assembly.problem.seed,
        },
    }


def _extent(pieces: Iterable[Recording]) -> tuple[int, float, float]:
    """Number of rows, first and last instant [s]."""
    ends = [(len(piece), float(piece.t[0]), float(piece.t[-1])) for piece in pieces]
    return sum(count for count, *_ in ends), ends[0][1], ends[-1][2]


LEGEND = (
    "error: torque error on the test part, all joints; worst RMS: number and RMS error of the "
    "worst joint, N·m or N; base: error of the base parameters where the true ones are known; "
    "λ_min/tr: smallest relative eigenvalue, below 0 is not consistent; gap: (L − L*)/L* in the "
    "weighted training loss that all rows share, L* the optimum over all consistent models "
    "without nets"
)


def _markdown(facts: Mapping[str, Any]) -> str:
    joints, units, rows = facts["joints"], facts["units"], facts["rows"]
    name = _plain(facts["recording"]["name"])
    lines = [f"# {facts['robot']}, {name}: every method on the same data", ""]
    lines += [f"- {_plain(sentence)}" for sentence in facts["advice"]["sentences"]]
    lines += ["", _line(HEAD), "|---" * len(HEAD) + "|"]
    lines += [_line(cells(row)) for row in rows]
    lines += [
        "",
        f"The URDF without friction has {facts['before_percent']:.3f} %. {LEGEND}.",
        "",
        _line(("RMS on test", *joints)),
        "|---" * (len(joints) + 1) + "|",
        _line(("unit", *(unit.replace("*", "·") for unit in units))),
    ]
    lines += [
        _line((row["method"], *(f"{x:.4f}" for x in row["rms"]))) for row in rows if "rms" in row
    ]
    lines += ["", *(f"- {row['method']}: {_plain(row['status'])}" for row in rows)]
    lines += ["", *(f"- {_plain(note)}" for note in facts["notes"])]
    return "\n".join(lines) + "\n"


def _line(words: tuple[str, ...]) -> str:
    return "| " + " | ".join(_plain(word.replace("|", "/")) for word in words) + " |"


def _plain(text: str) -> str:
    """Text in one line whose characters mean nothing to Markdown or HTML.

    Names of joints and logs are part of it, and they come from elsewhere.
    """
    flat = "".join(c if c.isprintable() else "_" for c in text)
    return re.sub(r"([\\`*\[\]|])", r"\\\1", html.escape(flat, quote=False))
