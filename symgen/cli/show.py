"""Commands on generated folders that need no library of the build: `list`, `describe`, `clean`."""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.common.files import json_of
from runtime.common.settings import Choices, argument_field, output_field
from runtime.common.tables import Table
from runtime.common.terminal import say, show
from runtime.common.user_builds import DEFAULT_ROOT, built_robots, generated_here
from symgen.cli.common import RobotArgument, RootOption, folders_of, robots
from symgen.errors import BuildError
from symgen.make import bundled_robots
from symgen.mechanics.combination import describe_combination

_DAMAGE = (  # exceptions that a damaged manifest can raise
    *(OSError, ValueError, ArithmeticError, LookupError),
    *(TypeError, AttributeError, RecursionError),
)

_LIMITS = ("lower", "upper", "velocity", "effort")


@dataclass(frozen=True, slots=True, kw_only=True)
class ListSettings(Choices):
    """Settings of `symgen list`."""

    options = "out"
    out: RootOption = DEFAULT_ROOT


def list_command(given: ListSettings) -> None:
    r"""List bundled and generated robots.

    \b
    symgen list

    The library of a generated robot is built, not compiled, or stale (built from other inputs).
    C code that comes with the installed package is compiled when it is used for the first time.
    """
    rows = []
    folders = {folder.name: folder for folder in generated_here(given.out)}
    unknown = False
    for name in sorted({*folders, *bundled_robots()}):
        library = "-"
        if name in folders:
            library = _state(name, folders[name])
            unknown = unknown or library == "built?"
        generated = "" if name not in folders else "yes"
        if name in folders and folders[name].parent != given.out:
            here = built_robots().get(name) == folders[name]
            generated = str(folders[name]) if here else "with the package"
        rows.append((name, "yes" if name in bundled_robots() else "", generated, library))
    show(Table(("robot", "bundled", "generated", "library"), tuple(rows)))
    if unknown:
        say(
            "built?: whether a library is stale is checked with casadi and pinocchio, which are "
            "not installed"
        )


def _state(name: str, folder: Path) -> str:
    """State of the library in a generated folder, one word for the table."""
    if not (folder / f"lib{name}.so").exists():
        return "not compiled"
    if name not in bundled_robots():
        return "built"
    try:
        from symgen.make.pipeline import is_current
        from symgen.make.request import bundled_request
    except ModuleNotFoundError:  # the inputs of a build include the versions of its packages
        return "built?"
    return "built" if is_current(bundled_request(name), folder) else "stale"


@dataclass(frozen=True, slots=True, kw_only=True)
class DescribeSettings(Choices):
    """Settings of `symgen describe`."""

    options = "as_json out"
    robot: str = argument_field("fr3", autocompletion=robots, help="Name of a generated robot.")
    as_json: bool = output_field(False, "--json", help="Print JSON.")
    out: RootOption = DEFAULT_ROOT


def describe_command(given: DescribeSettings) -> None:
    r"""Show joints, limits, base parameters and kernels of a robot.

    \b
    symgen describe fr3

    Positions in rad or m, velocities in rad/s or m/s, efforts in N·m or N. Base parameters are
    combinations of link parameters, such as link1.ZZ + link2.YY. Kernels are listed with the shapes
    of their arguments and their arithmetic operations.
    """
    here = {folder.name: folder for folder in generated_here(given.out)}
    folder = here[given.robot] if given.robot in here else folders_of(given.out, given.robot)[0]
    path = folder / "manifest.json"
    try:
        manifest = json_of(path)
        facts = json.dumps(_description(manifest), indent=1)
        tables = (_joint_table(manifest), _base_table(manifest), _kernel_table(manifest))
    except _DAMAGE as error:
        raise BuildError(
            f"'{path}' is damaged ({type(error).__name__}: {error}); build the robot again with: "
            "python -m symgen build"
        ) from None
    if given.as_json:
        print(facts)
        return
    for table in tables:
        show(table)


def _description(manifest: dict[str, Any]) -> dict[str, Any]:
    bodies = manifest.get("all_joints", manifest["joints"])
    names = [f"{j['link']}.{p}" for j in bodies for p in manifest["pi_names"]]
    base = manifest["base_parameters"]
    keys = ("robot", "base", "tip", "gravity", "joints", "home", "lumped", "removed", "kernels")
    some = [key for key in ("all_joints", "coupling", "loops") if key in manifest]
    return {key: manifest[key] for key in (*keys, *some)} | {
        "base_parameters": [describe_combination(names, row) for row in base["matrix"]],
        "smallest_kept": base["smallest_kept"],
        "largest_dropped_below": base["largest_dropped_below"],
        "model_hash": manifest["model_hash"],
    }


def _joint_table(manifest: dict[str, Any]) -> Table:
    free = {joint["name"] for joint in manifest["joints"]}
    ends = [(j, f"{x:.3f}") for j, x in zip(manifest["joints"], manifest["home"], strict=True)]
    for place, joint in enumerate(manifest.get("all_joints", [])):
        if joint["name"] not in free:
            ends.append((joint, _follows(manifest, place)))
    rows = []
    for joint, end in ends:
        shown = ["none" if joint[key] is None else f"{joint[key]:.4g}" for key in _LIMITS]
        names = [str(joint[key]) for key in ("name", "link", "kind")]
        rows.append((*names, *shown, end))
    title = f"{manifest['robot']}: joints (rad or m, rad/s or m/s, N·m or N)"
    return Table(("joint", "moves", "kind", *_LIMITS, "home"), tuple(rows), title=title)


def _follows(manifest: dict[str, Any], place: int) -> str:
    """Joints or motors that move a dependent joint."""
    if "loops" in manifest:
        return "by the loops"
    if "coupling" not in manifest:
        return "free"
    row, offset = (manifest["coupling"][key][place] for key in ("matrix", "offset"))
    masters = zip(row, manifest["joints"], strict=True)
    terms = [f"{factor:.4g} {joint['name']}" for factor, joint in masters if factor]
    terms += [f"{offset:.4g}"] if offset or not terms else []
    return f"= {' + '.join(terms)}".replace("+ -", "- ")


def _base_table(manifest: dict[str, Any]) -> Table:
    facts = _description(manifest)
    title = (
        f"{len(facts['base_parameters'])} base parameters (singular values: kept ≥ "
        f"{facts['smallest_kept']:g}, dropped < {facts['largest_dropped_below']:g})"
    )
    rows = tuple((str(k), text) for k, text in enumerate(facts["base_parameters"], 1))
    return Table(("β", "combination"), rows, title=title)


def _kernel_table(manifest: dict[str, Any]) -> Table:
    rows = []
    for kernel in manifest["kernels"]:
        shapes = [
            ", ".join(f"{a['name']} {'×'.join(map(str, a['shape']))}" for a in kernel[side])
            for side in ("inputs", "outputs")
        ]
        cells = (kernel["name"], *shapes, kernel["operations"], kernel["equation"])
        rows.append(tuple(map(str, cells)))
    head = ("kernel", "inputs", "outputs", "operations", "equation")
    return Table(head, tuple(rows), title="kernels")


@dataclass(frozen=True, slots=True, kw_only=True)
class CleanSettings(Choices):
    """Settings of `symgen clean`."""

    options = "out"
    robot: RobotArgument = None
    out: RootOption = DEFAULT_ROOT


def clean_command(given: CleanSettings) -> None:
    r"""Delete compiled libraries and generated folders.

    \b
    symgen clean my

    Of a bundled robot only the library is deleted, of your own robot the whole folder.
    """
    for folder in folders_of(given.out, given.robot):
        if folder.name in bundled_robots():
            for path in (folder / f"lib{folder.name}.so", folder / "build.json"):
                path.unlink(missing_ok=True)
        else:
            shutil.rmtree(folder)
        say(f"{folder}: clean")
