"""One file of any kind → text of a URDF and a mechanism."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from symgen.build.sources.mjcf import robot_from_mjcf
from symgen.build.sources.sdf import robot_from_sdf
from symgen.build.sources.springs import merged
from symgen.chain.dh import robot_from_rows
from symgen.chain.mechanism import Mechanism
from symgen.documents import text_of, toml_of
from symgen.errors import BuildError
from symgen.ros import Packages, expanded


@dataclass(frozen=True, slots=True)
class Source:
    """A robot file and what it takes to read it.

    Attributes:
        path: the file, or `package://PACKAGE/path`.
        arguments: of xacro, name → value.
        packages: where ROS packages are searched.
    """

    path: Path
    arguments: Mapping[str, str] = field(default_factory=dict)
    packages: Packages = field(default_factory=Packages)


def read_source(
    source: Source,
    mechanism: Mechanism,
    note: Callable[[str], None] = lambda _: None,
    has_gravity: bool = False,
) -> tuple[str, Mechanism]:
    """Return the URDF of a robot file, and the mechanism.

    Args:
        source: URDF, xacro, MJCF, SDF or TOML of modified DH rows.
        mechanism: that of --mechanism.
        note: receives sentences on what of the file a build does not take.
        has_gravity: whether the build states the gravity, so that another one needs no note.

    Returns:
        Text of the URDF, and the mechanism of both files; `independent` and [assembly] of
        --mechanism count for the mechanism of the robot file too, and its springs stand beside
        those of MJCF and SDF.

    Raises:
        BuildError: the file cannot be read, or two files describe a mechanism.
        UrdfError: the contents are wrong.
    """
    path = source.packages.file(source.path)
    if source.arguments and path.suffix != ".xacro":
        raise BuildError(f"--arg belongs to xacro files, and '{path}' is none; leave it out")
    stated = Mechanism()
    if path.suffix == ".xacro":
        text = expanded(path, source.arguments, source.packages)
    elif path.suffix == ".toml":
        try:
            table = toml_of(path)
        except (OSError, ValueError) as error:
            raise BuildError(f"cannot read the robot '{path}': {error}") from None
        text, stated = robot_from_rows(table, f"'{path}'")
    else:
        text = urdf_text(path)
        if "<mujoco" in text and "<robot" not in text:
            text, stated = robot_from_mjcf(path, has_gravity, note)
        elif "<sdf" in text and "<robot" not in text:
            text, stated = robot_from_sdf(text, f"'{path}'")
    springs = merged(stated.spring, mechanism.spring) if path.suffix != ".toml" else ()
    if springs:
        stated, mechanism = replace(stated, spring=()), replace(mechanism, spring=())
    choice = Mechanism(independent=mechanism.independent, assembly=mechanism.assembly)
    if stated != Mechanism() and mechanism != choice:
        raise BuildError(
            f"'{path}' and --mechanism both describe a mechanism; move all tables into one of them"
        )
    if stated == Mechanism():
        return text, replace(mechanism, spring=springs or mechanism.spring)
    assembly = stated.assembly | mechanism.assembly
    independent = mechanism.independent or stated.independent
    changed = replace(stated, independent=independent, assembly=assembly)
    return text, replace(changed, spring=springs or stated.spring)


def urdf_text(path: Path) -> str:
    """Text of a file of UTF-8."""
    try:
        return text_of(path)
    except UnicodeDecodeError as error:
        raise BuildError(f"the URDF '{path}' is not UTF-8 text ({error.reason})") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BuildError(f"cannot read the URDF '{path}': {reason}") from None
