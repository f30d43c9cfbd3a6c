"""What the options of `build` ask for: the request and the levels."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.common.terminal import say
from symgen.chain import read_chain
from symgen.errors import BuildError
from symgen.make import bundled_name, bundled_robots
from symgen.make.compiler import levels_of_processor
from symgen.make.config import RobotConfig, read_config, reduced_config
from symgen.make.mesh_bodies import read_densities, with_mesh_bodies
from symgen.make.request import BuildRequest, bundled_request
from symgen.make.sources import read_source, split_by_use

if TYPE_CHECKING:
    from symgen.chain import ChainOptions
    from symgen.make.sources import Source


def levels_of(chosen: list[str] | None, every: bool, name: str) -> tuple[str, ...]:
    """Return the levels to compile."""
    if chosen and every:
        raise BuildError("--level and --all-levels both name levels; give one of them")
    if chosen or every or name in bundled_robots():
        return tuple(chosen or ())
    return levels_of_processor()


def changed_request(
    bundled: "BuildRequest", name: str | None, options: "ChainOptions"
) -> "BuildRequest":
    """A bundled robot that is cut, locked or mounted otherwise, with what is left of its limits."""
    if name is None or name in bundled_robots():
        raise BuildError(
            f"a changed '{bundled.name}' needs a --name that no bundled robot has, "
            f"such as {bundled.name}_changed"
        )
    whole, chain = read_chain(bundled.urdf), read_chain(bundled.urdf, options)
    config = reduced_config(bundled.config, whole, chain)
    return replace(bundled, name=name, options=options, config=config)


def request_from_urdf(
    source: "Source",
    name: str | None,
    options: "ChainOptions",
    project: bool,
    config: list[Path] | None,
    densities: Path | None = None,
) -> "BuildRequest":
    """The robot of a file of the user."""
    if name is None:
        raise BuildError(
            "--urdf needs --name, the name of the folder and the prefix of the C functions"
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
        say(f"note: mass and inertia of {', '.join(links)} from their meshes by --densities")
    of_file = tuple(s for s in mechanism.spring if s not in options.mechanism.spring)
    kept, left = split_by_use(text, replace(options, mechanism=mechanism), of_file)
    known = [(s.name, s.stiffness, s.rest) for s in kept if s.stiffness is not None]
    if known:
        listed = ", ".join(f"{spring} ({k:g}, rest {rest:g})" for spring, k, rest in known)
        say(f"note: springs of the file, whose torque counts as known: {listed}")
    if left:
        say(f"note: springs of the file that are left out: {', '.join(s.name for s in left)}")
    stated = tuple(s for s in mechanism.spring if s not in of_file)
    options = replace(options, mechanism=mechanism.replace(spring=(*stated, *kept)))
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
