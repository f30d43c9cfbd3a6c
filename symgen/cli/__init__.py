"""`python -m symgen build | check | list | describe | clean`: arguments in, sentences out.

`inspect` has a module of its own.
"""

import difflib
import json
import shutil
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from symgen.base_parameters import describe_combination
from symgen.build import build, generate, is_current
from symgen.chain import ChainOptions
from symgen.cli.inspect import inspect_command
from symgen.errors import BuildError, SymgenError
from symgen.request import (
    BuildRequest,
    RobotConfig,
    bundled_request,
    bundled_robots,
    read_config,
    request_from_folder,
)

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Write the physics of a robot arm as C and compile it: URDF in, generated/<robot>/ out.",
)
console = Console()

Root = Annotated[
    Path, typer.Option("--out", help="Folder that holds one folder per robot.", show_default=True)
]
DEFAULT_ROOT = Path("generated")


app.command("inspect")(inspect_command)


def main() -> None:
    """Run the command line; a `SymgenError` becomes one sentence and exit code 2."""
    try:
        app()
    except SymgenError as error:
        print(f"symgen: {error}", file=sys.stderr)
        raise SystemExit(2) from None


@app.command("build")
def build_command(
    robot: Annotated[str, typer.Option(help="A robot that ships with symgen.")] = "fr3",
    urdf: Annotated[
        Path | None, typer.Option(help="Your own robot instead; needs --name.", dir_okay=False)
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="Folder and C prefix of your robot: a-z, 0-9, _.")
    ] = None,
    base: Annotated[str | None, typer.Option(help="Link that is fixed to the world.")] = None,
    tip: Annotated[
        str | None, typer.Option(help="Last link; whatever hangs beyond it is cut off.")
    ] = None,
    gravity: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z", help="m/s² in the base frame; default 0,0,-9.81 at the root."
        ),
    ] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=VALUE", help="Freeze a joint at rad or m; repeatable."),
    ] = None,
    snap: Annotated[
        float, typer.Option(help="Take rpy within this of a multiple of π/2 as exact, e.g. 1e-4.")
    ] = 0.0,
    project: Annotated[
        bool, typer.Option("--project", help="Replace impossible inertias by the nearest possible.")
    ] = False,
    config: Annotated[
        Path | None, typer.Option(help="TOML with home, acceleration and jerk per joint.")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Rebuild although nothing changed.")
    ] = False,
    out: Root = DEFAULT_ROOT,
) -> None:
    r"""Generate and compile a robot's library.

    \b
    python -m symgen build                                     the Franka Research 3
    python -m symgen build --urdf my.urdf --name my            your robot
    python -m symgen build --urdf my.urdf --name my --tip tool0 --gravity 0,9.81,0
    """
    options = ChainOptions(base, tip, _vector(gravity), _locks(lock or []), snap)
    if urdf is None:
        if options != ChainOptions() or name or project or config:
            raise BuildError(
                "the options --name, --base, --tip, --gravity, --lock, --snap, --project and "
                "--config describe your own robot; give its --urdf too"
            )
        request = bundled_request(robot)
    else:
        request = _own_request(urdf, name, options, project, config)
    with console.status(f"building {request.name}"):
        result = build(request, out, force)
    for note in result.notes:
        console.print(f"note: {note}", highlight=False, soft_wrap=True)
    state = "built" if result.rebuilt else "up to date"
    console.print(f"{result.folder}: {state}", highlight=False, soft_wrap=True)


@app.command()
def check(
    robot: Annotated[str | None, typer.Argument(help="Default: every robot in the folder.")] = None,
    out: Root = DEFAULT_ROOT,
) -> None:
    """Regenerate in memory and compare with the files on disk; a difference is exit code 1."""
    different = []
    for folder in _folders(out, robot):
        bundled = folder.name in bundled_robots()
        request = bundled_request(folder.name) if bundled else request_from_folder(folder)
        emitted, _ = generate(request)
        for file, text in emitted.files.items():
            path = folder / file
            old = path.read_text(encoding="utf-8") if path.exists() else ""
            if old != text:
                different.append(folder)
                diff = difflib.unified_diff(
                    old.splitlines(), text.splitlines(), str(path), "regenerated", n=1, lineterm=""
                )
                sys.stdout.writelines(
                    f"{line}\n" for _, line in zip(range(200), diff, strict=False)
                )
        state = "differs, run: python -m symgen build" if folder in different else "in sync"
        console.print(f"{folder}: {state}", highlight=False, soft_wrap=True)
    raise typer.Exit(int(bool(different)))


@app.command("list")
def list_command(out: Root = DEFAULT_ROOT) -> None:
    """Robots that ship with symgen, and robots that have been generated here."""
    table = Table("robot", "bundled", "generated", "library")
    built = {folder.name for folder in out.glob("*/") if (folder / "manifest.json").exists()}
    for name in sorted(built | set(bundled_robots())):
        folder = out / name
        library = "-"
        if name in built:
            request = bundled_request(name) if name in bundled_robots() else None
            library = "built" if (folder / f"lib{name}.so").exists() else "not compiled"
            if request is not None and library == "built" and not is_current(request, folder):
                library = "stale"
        table.add_row(
            name, "yes" if name in bundled_robots() else "", "yes" if name in built else "", library
        )
    console.print(table)


@app.command()
def describe(
    robot: Annotated[str, typer.Argument(help="Name of a generated robot.")] = "fr3",
    as_json: Annotated[bool, typer.Option("--json", help="The facts as JSON.")] = False,
    out: Root = DEFAULT_ROOT,
) -> None:
    """Joints, limits, base parameters, and kernels with shapes and operation counts."""
    (folder,) = _folders(out, robot)
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    if as_json:
        print(json.dumps(_description(manifest), indent=1))
        return
    for table in (_joint_table(manifest), _base_table(manifest), _kernel_table(manifest)):
        console.print(table)


@app.command()
def clean(
    robot: Annotated[str | None, typer.Argument(help="Default: every robot in the folder.")] = None,
    out: Root = DEFAULT_ROOT,
) -> None:
    """Delete compiled libraries; of your own robots the generated folder as a whole."""
    for folder in _folders(out, robot):
        if folder.name in bundled_robots():
            for path in (folder / f"lib{folder.name}.so", folder / "build.json"):
                path.unlink(missing_ok=True)
        else:
            shutil.rmtree(folder)
        console.print(f"{folder}: clean", highlight=False, soft_wrap=True)


def _own_request(
    urdf: Path, name: str | None, options: ChainOptions, project: bool, config: Path | None
) -> BuildRequest:
    if name is None:
        raise BuildError(
            "--urdf needs --name, which becomes the folder and the prefix of the C code"
        )
    if name in bundled_robots():
        raise BuildError(f"'{name}' is the name of a bundled robot; choose another --name")
    try:
        text = urdf.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise BuildError(f"the URDF '{urdf}' is not UTF-8 text ({error.reason})") from None
    except OSError as error:
        raise BuildError(f"cannot read the URDF '{urdf}': {error.strerror}") from None
    return BuildRequest(
        name, text, options, read_config(config) if config else RobotConfig(), project
    )


def _vector(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise BuildError(f"--gravity needs three numbers X,Y,Z, got '{text}'") from None
    return x, y, z


def _locks(items: list[str]) -> dict[str, float]:
    locks = {}
    for item in items:
        joint, _, value = item.partition("=")
        try:
            locks[joint] = float(value)
        except ValueError:
            raise BuildError(f"--lock needs JOINT=VALUE with a number, got '{item}'") from None
    return locks


def _folders(out: Path, robot: str | None) -> list[Path]:
    if robot is not None:
        if not (out / robot / "manifest.json").exists():
            raise BuildError(
                f"'{out / robot}' holds no generated robot; run: python -m symgen build"
            )
        return [out / robot]
    return sorted(f for f in out.glob("[a-z]*/") if (f / "manifest.json").exists())


def _description(manifest: dict[str, Any]) -> dict[str, Any]:
    names = [f"{j['link']}.{p}" for j in manifest["joints"] for p in manifest["pi_names"]]
    base = manifest["base_parameters"]
    keys = ("robot", "base", "tip", "gravity", "joints", "home", "lumped", "removed", "kernels")
    return {key: manifest[key] for key in keys} | {
        "base_parameters": [describe_combination(names, row) for row in base["matrix"]],
        "smallest_kept": base["smallest_kept"],
        "largest_dropped_below": base["largest_dropped_below"],
        "model_hash": manifest["model_hash"],
    }


def _joint_table(manifest: dict[str, Any]) -> Table:
    table = Table("joint", "kind", "moves", "lower", "upper", "velocity", "effort", "home")
    table.title = f"{manifest['robot']}: joints (rad or m, N·m or N)"
    for joint, home in zip(manifest["joints"], manifest["home"], strict=True):
        limits = [joint[key] for key in ("lower", "upper", "velocity", "effort")]
        shown = ["none" if x is None else f"{x:g}" for x in limits]
        table.add_row(joint["name"], joint["kind"], joint["link"], *shown, f"{home:.4f}")
    return table


def _base_table(manifest: dict[str, Any]) -> Table:
    table = Table("β", "combination")
    facts = _description(manifest)
    table.title = (
        f"{len(facts['base_parameters'])} base parameters "
        f"(singular values: kept ≥ {facts['smallest_kept']:g}, "
        f"dropped < {facts['largest_dropped_below']:g})"
    )
    for k, text in enumerate(facts["base_parameters"], 1):
        table.add_row(str(k), text)
    return table


def _kernel_table(manifest: dict[str, Any]) -> Table:
    table = Table("kernel", "inputs", "outputs", "operations", "equation", title="kernels")
    for kernel in manifest["kernels"]:
        shapes = [
            ", ".join(f"{a['name']} {'×'.join(map(str, a['shape']))}" for a in kernel[side])
            for side in ("inputs", "outputs")
        ]
        table.add_row(kernel["name"], *shapes, str(kernel["operations"]), kernel["equation"])
    return table
