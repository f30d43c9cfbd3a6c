"""Results of a checkout for every kind of log and command, written and compared.

A case is a list of commands that run in an empty folder (`same_results_cases`). What they write is
kept as it is, with their exit codes and texts, and is read when two folders are compared: the rules
of the comparison can change without running anything again.
"""

import csv
import difflib
import filecmp
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from bench.same_results_cases import CASES, SCRIPTS
from bench.same_results_inputs import EXAMPLES, INPUTS
from runtime.identification.saved_result import migrated

LONGEST = 900.0
"""Time after which a command counts as failed, s."""
RTOL = 1e-9
LEVEL = "portable"
"""Instruction set that rounds alike on every machine."""
FLOOR = 1e-3
"""Share of the largest number of an array below which differences count relative to that share.
What is zero by structure or by cancellation carries the rounding of the largest number, 2e-16 times
a condition of up to 1e4; numbers down to a thousandth of the largest are compared at `RTOL`."""
ROUNDING = 10.0
SMALL = 1e-12
"""Smaller numbers of printed lines state rounding, such as the torques of a file read again."""
IGNORED = {"seconds": "time that a method took", "versions": "libraries of the environment"}
"""Key of a JSON, TOML or NPZ file that is not compared, with all below it → reason."""
MASKS = {
    r"(?<![\w.·)])(?:\.\.)?/(?:[\w.+@%-]+/)+": "/",  # folders; names of files stay
    r"(?<![\w.])(?=\d*[a-f])[0-9a-f]{16,}\b": "HASH",  # of files, models and C code
    r"\b\d+\.\d+\.\d+(?:\.?(?:post|dev|rc)\d+)?\b": "VERSION",
    r"\b\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d)?(?:\.\d+)?(?:Z|[+-]\d\d:\d\d)?)?": "DATE",
    r"(time of the method: )\S+ s\b": r"\1TIME",
    r"(Computing time<b>)[^<]*": r"\1TIME",
    # Of a method in the tables of `compare`: name, error, worst joint, error of π, time.
    r"^((?:\| )?[a-z-]+ (?:\| )?(?:\S+ (?:\| )?){2}j\d+ \S+ (?:\| )?\S+ (?:\| )?)[\d.]+": r"\1TIME",
    r"(data-m=[^>]+>(?:<td>[^<]*</td>){5}<td>)[\d.]+": r"\1TIME",
    r"\s*<svg\b[\s\S]*?</svg>\s*": "PICTURE",  # of numbers that stand in other files
}
"""Expression → what replaces it in every text."""
UNREAD = (".png", ".pdf", ".so", ".mcap", ".usdc", ".lock", "build.json")
"""Ends of files of which only the existence is compared: pictures, compiled code, bags with the
time of their writing, the number of a process, times of the compiler."""
NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.]*[A-Za-z_])")
Value = np.ndarray | list[str]
"""Numbers of a key, or lines of text."""


def chosen(only: Iterable[str]) -> list[str]:
    """Cases whose names begin with a word of `only`, all where it is empty; their robots first."""
    only = tuple(only)
    for name in only:
        if not any(case.startswith(name) for case in CASES):
            raise ValueError(f"expected a case, got '{name}'; there are {', '.join(CASES)}")
    names = [case for case in CASES if not only or case.startswith(only)]
    words = " ".join(line for name in names for line in CASES[name])
    robots = [case for case in CASES if case.startswith("robot-") and f"{{{case[6:]}}}" in words]
    return list(dict.fromkeys([*robots, *names]))


def write(folder: Path, tree: Path, only: Iterable[str], jobs: int, level: str = LEVEL) -> None:
    """Run cases with the commands of a checkout; a command that fails is a result.

    Cases of the folder are replaced, but a robot that `only` does not name is used as it is.
    """
    only, folder, tree = tuple(only), folder.resolve(), tree.resolve()
    shared = Path(os.environ.get("SYMGEN_DATA", Path(__file__).resolve().parents[3] / "shared"))
    names = chosen(only)
    if only:
        is_made = {n for n in names if not n.startswith(only) and (folder / f"{n}.json").is_file()}
        names = [n for n in names if n not in is_made]
    words = " ".join(line for name in names for line in CASES[name])
    for name in (name for name in INPUTS if f"{{inputs}}/{name}" in words):
        place = folder / "inputs" / name
        place.parent.mkdir(parents=True, exist_ok=True)
        INPUTS[name](place, shared)
    places = {n[6:]: f"../{n}/{n[6:]}" for n in CASES if n.startswith("robot-")} | {
        "inputs": "../inputs",
        "data": str(shared / "data"),
        "models": str(shared / "models"),
        "examples": str(EXAMPLES),
        "tree": str(tree),
        "level": level,
    }
    environment, done = _environment(folder, tree, shared), 0

    def case(name: str) -> None:
        nonlocal done
        runs = _run(name, folder, places, environment)
        (folder / f"{name}.json").write_text(json.dumps(runs), encoding="utf-8")
        done += 1
        spent, codes = sum(run["seconds"] for run in runs), [run["exit"] for run in runs]
        print(f"[{done}/{len(names)}] {name}: {spent:.1f} s, exit {codes}", flush=True)

    with ThreadPoolExecutor(jobs) as pool:
        for is_robot in (True, False):
            list(pool.map(case, [n for n in names if n.startswith("robot-") == is_robot]))


def _python(tree: Path) -> str:
    own = tree / ".venv" / "bin" / "python"
    return str(own if own.exists() else sys.executable)


def _environment(folder: Path, tree: Path, shared: Path) -> dict[str, str]:
    """Environment of a user who has nothing but the folder, on a wide terminal, one thread."""
    kept = ("PATH", "TMPDIR", "CCACHE_DIR", "SYMGEN_OBJECTS", "LD_LIBRARY_PATH")
    environment = {name: os.environ[name] for name in kept if name in os.environ}
    environment |= {"HOME": str(folder / "home"), "PYTHONPATH": str(tree), "COLUMNS": "200"}
    environment |= {"SYMGEN_DATA": str(shared), "LANG": "C.UTF-8", "MPLBACKEND": "agg"}
    environment |= {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}
    (folder / "home").mkdir(parents=True, exist_ok=True)
    first_figure = [_python(tree), "-c", "import matplotlib.font_manager"]  # writes a cache
    subprocess.run(first_figure, env=environment, capture_output=True, check=False)
    return environment


_SYMGEN = (
    "import sys; sys.argv[0] = 'symgen'; from symgen.cli.console import main; sys.exit(main())"
)


def _run(
    name: str, folder: Path, places: dict[str, str], environment: dict[str, str]
) -> list[dict[str, Any]]:
    """Run the commands of a case in its folder, whatever becomes of those before."""
    place, runs = folder / name, []
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for line in CASES[name]:
        words = [word.format(**places) for word in shlex.split(line)]
        words = [SCRIPTS[words[1]], *words[2:]] if words[0] == "python" else [_SYMGEN, *words]
        argv = [_python(Path(environment["PYTHONPATH"])), "-c", *words]
        begin, how = time.perf_counter(), {"stdin": subprocess.DEVNULL, "capture_output": True}
        try:
            run = subprocess.run(argv, cwd=place, env=environment, timeout=LONGEST, **how)  # noqa: PLW1510
            code, texts = run.returncode, (run.stdout, run.stderr)
        except subprocess.TimeoutExpired as late:
            code, texts = 124, (late.stdout or b"", late.stderr or b"")
        out, err = (text.decode(errors="replace") for text in texts)
        took = time.perf_counter() - begin
        runs.append({"command": line, "exit": code, "out": out, "err": err, "seconds": took})
    return runs


def compare(
    before: Path,
    after: Path,
    only: Iterable[str],
    rtol: float,
    say: Callable[[str], None],
    rounded: Path | None = None,
) -> int:
    """Number of differences of two folders of `write`; every one is a line of `say`.

    Without `only` a case that one folder lacks is a difference. `rounded` is the first checkout at
    another level: numbers may differ by `ROUNDING` times what they differ by there.
    """
    only = tuple(only)
    held = sorted({path.stem for folder in (before, after) for path in folder.glob("*.json")})
    names = chosen(only) if only else held
    count, largest, agree = 0, 0.0, 0
    for name in names:
        lacking = [str(x) for x in (before, after) if not (x / f"{name}.json").is_file()]
        lines = [f"no such case in {' and '.join(lacking)}"] if lacking else []
        if not lacking:
            same = _same_files(before / name, after / name)
            old, new = (dict(values_of(x, name, same)) for x in (before, after))
            other = dict(values_of(rounded, name, same)) if rounded else {}
            lines += [f"{key}: only before" for key in old if key not in new]
            lines += [f"{key}: only after" for key in new if key not in old]
            for key in (key for key in old if key in new):
                allowed = rtol
                if key in other:
                    allowed = max(rtol, ROUNDING * difference(old[key], other[key], 0.0)[1])
                found, error = difference(old[key], new[key], allowed)
                lines += [f"{key}: {line}" for line in found]
                largest = largest if found else max(largest, error)
        count, agree = count + len(lines), agree + (not lines)
        for line in lines:
            say(f"{name}: {line}")
    say(f"{agree} of {len(names)} cases agree, {count} differences; the largest that was accepted "
        f"is {largest:.1g}, relative")  # fmt: skip
    return count


def difference(old: Value, new: Value, rtol: float) -> tuple[list[str], float]:
    """Sentences on how two values differ, and the largest relative difference."""
    if isinstance(old, list) or isinstance(new, list):
        return _text_difference(*([str(x) for x in np.ravel(each)] for each in (old, new)), rtol)
    if old.shape != new.shape:
        return [f"shape {old.shape} → {new.shape}"], np.inf
    if np.array_equal(old, new, equal_nan=True):
        return [], 0.0
    finite = np.isfinite(old) & np.isfinite(new)
    with np.errstate(invalid="ignore"):
        size = np.where(finite, np.maximum(np.abs(old), np.abs(new)), 0.0)
        agree = (old == new) | (np.isnan(old) & np.isnan(new))
        apart = np.where(agree, 0.0, np.where(finite, np.abs(old - new), np.inf))
        relative = apart / np.maximum(np.maximum(size, FLOOR * size.max()), np.finfo(float).tiny)
    wrong = relative > rtol
    if not wrong.any():
        return [], float(relative.max())
    at = np.unravel_index(np.argmax(relative), old.shape)
    where = f" at {list(map(int, at))}, {wrong.sum()} of {old.size} numbers" if at else ""
    return [f"{old[at]:.17g} → {new[at]:.17g} (relative {relative[at]:.1e}){where}"], float(
        relative.max()
    )


def _text_difference(old: list[str], new: list[str], rtol: float) -> tuple[list[str], float]:
    """Lines whose words differ; where all words agree, those whose numbers do not."""
    plain = [[NUMBER.sub("#", line) for line in lines] for lines in (old, new)]
    if plain[0] != plain[1]:
        lines = difflib.unified_diff(*plain, lineterm="", n=0)
        return [x for x in lines if not x.startswith(("---", "+++", "@@"))], np.inf
    found, largest = [], 0.0
    for one, other in zip(old, new, strict=True):
        if one == other:
            continue
        a, b = (np.array(NUMBER.findall(line), dtype=float) for line in (one, other))
        size = np.maximum(np.maximum(np.abs(a), np.abs(b)), np.finfo(float).tiny)
        relative = np.where(size > SMALL, np.abs(a - b) / size, 0.0)
        if (relative > rtol).any():
            found.append(f"'{one.strip()}' → '{other.strip()}'")
        largest = max(largest, float(relative.max()))
    return found, largest


def _same_files(before: Path, after: Path) -> set[str]:
    """Names of files with the same bytes in both folders, which need not be read."""
    names = {str(p.relative_to(before)) for p in before.rglob("*") if p.is_file()}
    pairs = ((name, before / name, after / name) for name in names)
    return {k for k, a, b in pairs if b.is_file() and filecmp.cmp(a, b, shallow=False)}


def values_of(
    folder: Path, case: str, left_out: Collection[str] = ()
) -> Iterator[tuple[str, Value]]:
    """Exit codes, texts and files of a case, except some files: key → numbers or lines."""
    for number, run in enumerate(json.loads((folder / f"{case}.json").read_text("utf-8")), 1):
        head = f"{number}. {run['command']}"
        yield f"{head}: exit code", np.array(float(run["exit"]))
        yield f"{head}: stdout", _lines(run["out"])
        yield f"{head}: stderr", _lines(run["err"])
    files = {str(p.relative_to(folder / case)): p for p in (folder / case).rglob("*")}
    for name, path in sorted(files.items()):
        if path.is_dir() or name in left_out:
            continue
        if name.endswith(UNREAD):
            yield name, ["exists"]
            continue
        try:
            tree = _READERS[path.suffix](path)
        except (KeyError, ValueError):
            tree = _lines(path.read_text("utf-8", errors="replace"))
        yield from _flat(f"{name} ", tree)


def _lines(text: str) -> list[str]:
    text = "\n".join(" ".join(line.split()) for line in text.splitlines())
    for expression, instead in MASKS.items():
        text = re.sub(expression, instead, text, flags=re.MULTILINE)
    return text.splitlines()


def _read_npz(path: Path) -> dict[str, Any]:
    """Arrays; of roots the products, since Q R and R describe the same for every rotation Q."""
    data = dict(np.load(path))
    if "pi_root" in data:
        root = data.pop("pi_root")
        data["pi_root pi_rootᵀ"] = root @ root.T
    if "factor" in data:
        whole = np.column_stack([data.pop("factor"), data.pop("target")])
        data["[factor target]ᵀ [factor target]"] = whole.T @ whole
    return data


def _present(value: Any) -> Any:
    """A document of an earlier format under the names of the present one."""
    if isinstance(value, dict) and ("free_base" in value or value.get("base") == "free"):
        return _walking(value)
    if isinstance(value, dict) and "torque_rms" in value and "format" in value:
        value = migrated(value)
    for row in value.get("rows", ()) if isinstance(value, dict) else ():
        if isinstance(row, dict) and "told_by_data" in row:
            row["determined"] = row.pop("told_by_data")  # of compare.json
    return value


def _walking(value: dict[str, Any]) -> dict[str, Any]:
    """What a result of a free base states in all formats."""
    same = {key: value[key] for key in ("robot", "rows", "status", "total_mass", "pi", "beta")}
    if "free_base" in value:
        return same | {
            "n_eff": value["n_eff"],
            "sigma": value["sigma"],
            "notes": value["notes"],
            "sensors": value["sensors"],
            "before": [row["before"] for row in value["errors"]],
            "after": [row["after"] for row in value["errors"]],
        }
    return same | {
        "n_eff": value["uncertainty"]["n_eff"],
        "sigma": value["uncertainty"]["pi_sigma"],
        "notes": value["warnings"],
        "sensors": {k: each["value"] for k, each in (value.get("sensors") or {}).items()},
        "before": value["torque_rms"]["before"],
        "after": value["torque_rms"]["after"],
    }


def _read_csv(path: Path) -> Any:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return {"header": header, **dict(zip(header, np.array(rows).T, strict=True))}


_READERS: dict[str, Callable[[Path], Any]] = {
    ".json": lambda path: _present(json.loads(path.read_text("utf-8"))),
    ".jsonl": lambda path: [json.loads(line) for line in path.read_text("utf-8").splitlines()],
    ".toml": lambda path: tomllib.loads(path.read_text("utf-8")),
    ".npz": _read_npz,
    ".csv": _read_csv,
}


def _flat(key: str, value: Any) -> Iterator[tuple[str, Value]]:
    """Leaves of nested values; an array of numbers is one leaf, None in it is NaN."""
    if isinstance(value, dict):
        for name, part in value.items():
            if name not in IGNORED:
                yield from _flat(f"{key}.{name}".replace(" .", " "), part)
        return
    try:
        yield key, np.array(value, dtype=float)
    except (ValueError, TypeError):
        if isinstance(value, list) and not all(isinstance(part, str) for part in value):
            for k, part in enumerate(value):
                yield from _flat(f"{key}[{k}]", part)
        else:
            yield key, [line for part in np.ravel(value) for line in _lines(str(part))]
