"""Commands that write generated folders and compare them: `build`, `check`."""

import difflib
import re
import sys
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import typer

from runtime.common.records import record_from_toml
from runtime.common.settings import Choices, data_field, method_field, model_field, output_field
from runtime.common.terminal import completing, console, say
from runtime.common.user_builds import DEFAULT_ROOT
from symgen.chain import ChainOptions, read_chain
from symgen.chain.mechanism import Mechanism, mechanism_from_table
from symgen.cli import common
from symgen.errors import BuildError
from symgen.make import bundled_name, bundled_robots
from symgen.make.casadi_files import write_casadi
from symgen.make.compiler import levels_of_processor
from symgen.make.config import RobotConfig, read_config, read_masses, reduced_config
from symgen.make.mesh_bodies import read_densities, with_mesh_bodies
from symgen.make.pipeline import build, generate, write_controller
from symgen.make.request import BuildRequest, bundled_request, request_from_folder
from symgen.ros.packages import Packages
from symgen.sources import Source, published_urdf, read_source
from symgen.sources.springs import with_springs_of_file

_OF_URDF = ["project", "config", "masses", "densities", "mechanism", "arg", "package", "model"]
"""Choices that belong to a robot of the user."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildSettings(Choices):
    """Settings of `symgen build`."""

    options = (
        "robot urdf description name base tip gravity lock mechanism config floating out overwrite"
    )
    robot: str = data_field(
        "fr3",
        autocompletion=completing(bundled_robots()),
        help="Name of a bundled robot, see `symgen list`, or of a built one, to change it "
        "under a new --name.",
    )
    urdf: Path | None = data_field(
        help="File of your own robot: URDF, xacro, MJCF, SDF or TOML of modified DH rows; "
        "package://PACKAGE/path is searched in ROS packages. Needs --name.",
        dir_okay=False,
    )
    description: str | None = data_field(
        metavar="NAME",
        help="Published robot of robot_descriptions or example-robot-data, where installed.",
    )
    name: str | None = output_field(
        help="Name of the folder and prefix of the C functions: a-z, 0-9, _."
    )
    base: common.BaseOption = None
    tip: common.TipOption = None
    gravity: str | None = model_field(
        metavar="X,Y,Z",
        help="Gravity in the base frame, m/s². Default: 0,0,-9.81 in the root frame.",
    )
    lock: common.LockOption = None
    snap: float = method_field(
        0.0,
        help="Replace rpy angles within this distance, rad, of a multiple of π/2 by the "
        "multiple; 1e-4 for a URDF that rounds its angles.",
    )
    project: bool = method_field(
        False, help="Replace physically inconsistent inertias by the nearest consistent ones."
    )
    floating: bool = model_field(
        False,
        help="Free the base link: kernels take its pose, velocity and acceleration and have "
        "six rows for it before those of the joints. Gravity is in the world's frame.",
    )
    masses: Path | None = model_field(
        metavar="FILE",
        help="TOML file of masses (link = kg) of links without <inertial>. Without it, a URDF "
        "without any <inertial> gets placeholders, which are no prior.",
        dir_okay=False,
    )
    densities: Path | None = model_field(
        metavar="FILE",
        help="TOML file of densities (link = kg/m^3, default = kg/m^3 for all others) of links "
        "without <inertial>, whose bodies are computed from their closed meshes.",
        dir_okay=False,
    )
    mechanism: common.MechanismOption = None
    arg: common.ArgumentOption = None
    package: common.PackageOption = None
    model: common.ModelOption = None
    config: common.ConfigOption = None
    level: list[str] | None = method_field(
        help="Instruction set to compile for: v4 (AVX-512), v3 (AVX2), v2 (SSE), neon (ARM), "
        "portable, or casadi (reference code by CasADi); repeatable. Default: this processor's "
        "and portable, for bundled robots all; the best that the processor supports is chosen "
        "when the library is loaded."
    )
    all_levels: bool = method_field(
        False, help="Compile every level of this machine, for a library that others will load."
    )
    kernels: str | None = output_field(
        metavar="A,B,…",
        help="Write only these kernels, as one C file and one header for a microcontroller in "
        "OUT/NAME/controller/, and compile nothing.",
    )
    precision: str = output_field(
        "double", help="Numbers of the files of the setting kernels: double or single."
    )
    casadi: bool = output_field(
        False,
        help="Write NAME.casadi (serialised functions of CasADi) and NAME_casadi.c (the same "
        "with CasADi's ABI and Jacobians) too.",
    )
    watch_size: bool = method_field(
        False, help="Print operations, CPU time and memory to expect before the compilation starts."
    )
    force: bool = method_field(False, help="Rebuild even if the folder is up to date.")
    out: common.RootOption = DEFAULT_ROOT
    overwrite: common.OverwriteOption = False


def build_command(given: BuildSettings) -> None:
    r"""Generate and compile the C library of a robot arm.

    \b
    python -m symgen build                             the Franka Research 3
    python -m symgen build --urdf my.urdf --name my    your robot
    python -m symgen build --urdf my.urdf --name my --tip tool0 --gravity 0,9.81,0
    python -m symgen build --robot fr3 --name fr3_six --lock fr3_joint7=0
    python -m symgen build --settings kernels=inverse_dynamics --settings precision=single

    Reads a URDF, derives the kernels (torques, regressor, base parameters, derivatives), writes
    them as C to OUT/NAME/ and compiles one library: of your own robot for the instruction set of
    this processor and a portable one, with --settings all_levels=true for every one of this
    machine.
    Nothing is done if the folder is up to date; the files of an earlier build are replaced.
    """
    options = ChainOptions(
        given.base,
        given.tip,
        vector_of(given.gravity),
        common.read_locks(given.lock or []),
        given.snap,
        floating=given.floating,
    )
    urdf, name = given.urdf, given.name
    if given.description is not None:
        if urdf is not None:
            raise BuildError("--urdf and --description both name a robot; give one of them")
        urdf, name = published_urdf(given.description), name or given.description.lower()
    if urdf is None:
        if any(getattr(given, each) for each in _OF_URDF):
            raise BuildError(
                "--mechanism, --config and the settings project, masses, densities, arg, package "
                "and model belong to your own robot; give its --urdf too"
            )
        request = built_request(given.robot, given.out)
        if options != ChainOptions() or name:
            request = changed_request(request, name, options)
    else:
        masses = read_masses(given.masses) if given.masses else {}
        options = replace(options, masses=masses, mechanism=read_mechanism(given.mechanism))
        arguments = common.read_arguments(given.arg or [])
        source = Source(urdf, arguments, Packages(tuple(given.package or ())), given.model)
        request = request_from_urdf(
            source, name, options, given.project, given.config, given.densities
        )
    if given.kernels is not None:
        names = [word.strip() for word in given.kernels.split(",")]
        folder = write_controller(request, given.out, names, given.precision, given.overwrite)
        say(f"{folder}: written")
        return
    if given.precision != "double":
        raise BuildError(
            "the setting precision belongs to the setting kernels; name the kernels to write"
        )
    levels = levels_of(given.level, given.all_levels, request.name)
    with console.status(f"building {request.name}"):
        watch = (lambda cost: say(f"{request.name}: {cost}")) if given.watch_size else None
        result = build(request, given.out, given.force, levels, given.overwrite, watch)
    for note in result.notes:
        say(f"note: {note}")
    state = "built" if result.rebuilt else "up to date"
    say(f"{result.folder}: {state}")
    if given.casadi:
        for path in write_casadi(request, result.folder):
            say(f"{path}: written")


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckSettings(Choices):
    """Settings of `symgen check`."""

    options = "out"
    robot: common.RobotArgument = None
    out: common.RootOption = DEFAULT_ROOT


def check_command(given: CheckSettings) -> None:
    r"""Compare generated files with the C code that symgen writes today.

    \b
    symgen check fr3

    Nothing is written. Differences are printed as a unified diff. Exit code: 0 equal, 1 different.
    """
    different = []
    for folder in common.folders_of(given.out, given.robot):
        bundled = folder.name in bundled_robots()
        request = bundled_request(folder.name) if bundled else request_from_folder(folder)
        files, _ = generate(request)
        for file, text in files.items():
            path = folder / file
            old = path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""
            if old != text:
                different.append(folder)
                diff = difflib.unified_diff(
                    old.splitlines(), text.splitlines(), str(path), "regenerated", n=1, lineterm=""
                )
                sys.stdout.writelines(
                    f"{line}\n" for _, line in zip(range(200), diff, strict=False)
                )
        state = "differs, run: python -m symgen build" if folder in different else "in sync"
        say(f"{folder}: {state}")
    raise typer.Exit(int(bool(different)))


def levels_of(chosen: list[str] | None, every: bool, name: str) -> tuple[str, ...]:
    """Return the levels to compile."""
    if chosen and every:
        raise BuildError(
            "the setting level and --settings all_levels=true both name levels; give one of them"
        )
    if chosen or every or name in bundled_robots():
        return tuple(chosen or ())
    return levels_of_processor()


def changed_request(bundled: BuildRequest, name: str | None, options: ChainOptions) -> BuildRequest:
    """A known robot that is cut, locked or mounted otherwise, with what is left of its limits."""
    if name is None or name in bundled_robots():
        raise BuildError(
            f"a changed '{bundled.name}' needs a --name that no bundled robot has, "
            f"such as {bundled.name}_changed"
        )
    usual = ChainOptions()
    given = {each.name: getattr(options, each.name) for each in fields(options)}
    changes = {key: x for key, x in given.items() if x != getattr(usual, key)}
    options = replace(bundled.options, **changes)
    whole, chain = read_chain(bundled.urdf, bundled.options), read_chain(bundled.urdf, options)
    config = reduced_config(bundled.config, whole, chain)
    return replace(bundled, name=name, options=options, config=config)


def built_request(robot: str, out: Path) -> BuildRequest:
    """Request of a bundled robot, or of one that was built into a folder."""
    places = (Path(robot), out / robot)
    built = next((place for place in places if (place / "manifest.json").is_file()), None)
    if built is None or robot in bundled_robots():
        return bundled_request(robot)
    return request_from_folder(built.resolve())


def request_from_urdf(
    source: Source,
    name: str | None,
    options: ChainOptions,
    project: bool,
    config: list[Path] | None,
    densities: Path | None = None,
) -> BuildRequest:
    """The robot of a file of the user."""
    if name is None:
        raise BuildError(
            "--urdf needs --name, the name of the folder and the prefix of the C functions, "
            f"such as {re.sub('[^a-z0-9]+', '_', source.path.stem.lower())}"
        )
    if name in bundled_robots():
        raise BuildError(f"'{name}' is the name of a bundled robot; choose another --name")
    notes: list[str] = []
    has_gravity = options.gravity is not None
    text, mechanism = read_source(source, options.mechanism, notes.append, has_gravity)
    for sentence in notes:
        say(f"note: {sentence}")
    if densities is not None:
        folder = source.packages.file(source.path).parent
        text, links = with_mesh_bodies(text, folder, read_densities(densities), source.packages)
        listed = ", ".join(links)
        say(f"note: mass and inertia of {listed} from their meshes by the setting densities")
    options = with_springs_of_file(text, options, mechanism, lambda note: say(f"note: {note}"))
    if config is None and not project and (robot := bundled_name(text)) is not None:
        return changed_request(bundled_request(robot), name, options)
    facts = read_config(*config) if config else RobotConfig()
    return BuildRequest(name, text, options, facts, project)


def vector_of(text: str | None) -> tuple[float, float, float] | None:
    """Three numbers X,Y,Z of an option [m/s²]; None without a text."""
    if text is None:
        return None
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise BuildError(f"--gravity needs three numbers X,Y,Z, got '{text}'") from None
    return x, y, z


def read_mechanism(path: Path | None) -> Mechanism:
    """Return the mechanism of a TOML file, an empty one without a file."""
    if path is None:
        return Mechanism()
    table = record_from_toml(dict[str, Any], path, f"the mechanism '{path}'", BuildError)
    return mechanism_from_table(table, f"'{path}'")
