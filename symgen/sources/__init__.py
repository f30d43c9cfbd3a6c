"""Robot files as users have them → text of a URDF and a mechanism.

| source | module |
|---|---|
| URDF | read as it is |
| `package://PACKAGE/path` | `symgen.ros` finds the folder of the ROS package |
| `.xacro` | `symgen.ros` expands it |
| `.toml` of modified DH rows | `symgen.chain.dh` |
| MJCF | `mjcf`, compiled by MuJoCo in a process with limits (`compiled_mjcf`, `mjcf_child`) |
| SDF | `sdf` |
| springs of MJCF and SDF | `springs` |
| several robots in one file | the one with moving joints, or the name of `--model` |
| name of a published robot | robot_descriptions or example-robot-data, where installed |
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import files
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, tostring

from runtime.common.files import text_of
from runtime.common.records import record_from_toml
from symgen.chain.dh import robot_from_rows
from symgen.chain.document import MOVING, first_element, listing, parse
from symgen.chain.mechanism import Mechanism
from symgen.chain.normalise import Note
from symgen.errors import BuildError, UrdfError
from symgen.ros.packages import Packages, expanded
from symgen.sources.mjcf import robot_from_mjcf
from symgen.sources.sdf import robot_from_sdf
from symgen.sources.springs import merged


def robot_tree(text: str, chosen: str | None, where: str, note: Note) -> str:
    """Text of the URDF with the links of one tree; unchanged where there is one."""
    root = parse(text)
    links = {link.get("name", ""): link for link in root.findall("link")}
    joints = [(j, _end(j, "parent"), _end(j, "child")) for j in root.findall("joint")]
    children = {child for _, _, child in joints}
    tops = [name for name in links if name not in children]
    ends = {end for _, parent, child in joints for end in (parent, child)}
    if "" in links or not ends <= links.keys():
        return text  # `chain` says what is wrong
    if len(tops) < 2:
        if chosen is not None:
            raise BuildError(
                f"--model chooses among the robots of a file, and {where} has one; leave it out"
            )
        return text
    trees = {top: _reached(top, joints) for top in tops}
    moving = [
        top
        for top, reached in trees.items()
        if any(j.get("type") in MOVING and parent in reached for j, parent, _ in joints)
    ]
    if chosen is None and len(moving) > 1:
        raise BuildError(
            f"{where} has {len(moving)} robots that no joint connects; choose one by its root link "
            f"with --model: {listing(moving)}"
        )
    if chosen is not None and chosen not in trees:
        raise BuildError(
            f"--model names '{chosen}', which is not the root link of a robot of {where}; these "
            f"are {listing(moving)}"
        )
    if chosen is None and not moving:
        return text
    kept = trees[chosen or moving[0]]
    for name, link in links.items():
        if name not in kept:
            root.remove(link)
    for joint, parent, child in joints:
        if parent not in kept and child not in kept:
            root.remove(joint)
    others = [top for top in tops if top not in kept]
    note(f"links that no joint connects to the robot are left out: {listing(others)}")
    return tostring(root, "unicode") + "\n"


def _end(joint: Element, which: str) -> str:
    node = joint.find(which)
    return "" if node is None else node.get("link", "")


def _reached(top: str, joints: list[tuple[Element, str, str]]) -> set[str]:
    reached, pending = {top}, [top]
    while pending:
        link = pending.pop()
        fresh = [child for _, parent, child in joints if parent == link and child not in reached]
        reached |= set(fresh)
        pending += fresh
    return reached


_ROBOTS = "share/example-robot-data/robots/"


@dataclass(frozen=True, slots=True)
class Source:
    """A robot file and what it takes to read it."""

    path: Path  # the file, or `package://PACKAGE/path`
    arguments: Mapping[str, str] = field(default_factory=dict)  # of xacro, name → value
    packages: Packages = field(default_factory=Packages)  # where ROS packages are searched
    model: str | None = None  # robot of a file that has several


def read_source(
    source: Source, mechanism: Mechanism, note: Note = lambda _: None, has_gravity: bool = False
) -> tuple[str, Mechanism]:
    """Text of the URDF of a robot file, and the mechanism of it and of --mechanism.

    `independent` and [assembly] of --mechanism count for the mechanism of the robot file too, and
    its springs stand beside those of MJCF and SDF. A gravity that the build states needs no note.
    """
    path = source.packages.file(source.path)
    if source.arguments and path.suffix != ".xacro":
        raise BuildError(
            f"the setting arg belongs to xacro files, and '{path}' is none; leave it out"
        )
    stated = Mechanism()
    if path.suffix == ".xacro":
        text = expanded(path, source.arguments, source.packages)
    elif path.suffix == ".toml":
        table = record_from_toml(dict[str, Any], path, f"the robot '{path}'", BuildError)
        text, stated = robot_from_rows(table, f"'{path}'")
    else:
        text = urdf_text(path)
    form = first_element(text)
    if form == "mujoco":
        text, stated = robot_from_mjcf(path, source.model, has_gravity, note)
    elif form == "sdf":
        text, stated = robot_from_sdf(text, source.model, f"'{path}'", has_gravity, note)
    text = robot_tree(text, None if form in {"mujoco", "sdf"} else source.model, f"'{path}'", note)
    springs = merged(stated.spring, mechanism.spring) if path.suffix != ".toml" else ()
    if springs:
        stated, mechanism = stated.replace(spring=()), mechanism.replace(spring=())
    choice = Mechanism(independent=mechanism.independent, assembly=mechanism.assembly)
    if stated != Mechanism() and mechanism != choice:
        raise BuildError(
            f"'{path}' and --mechanism both describe a mechanism; move all tables into one of them"
        )
    if stated == Mechanism():
        return text, mechanism.replace(spring=springs or mechanism.spring)
    assembly = stated.assembly | mechanism.assembly
    independent = mechanism.independent or stated.independent
    changed = stated.replace(independent=independent, assembly=assembly)
    return text, changed.replace(spring=springs or stated.spring)


def urdf_text(path: Path) -> str:
    """Text of a file of UTF-8."""
    try:
        return text_of(path)
    except UnicodeDecodeError as error:
        raise UrdfError(f"'{path}' is not UTF-8 text ({error.reason}); convert it") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise UrdfError(f"cannot read the URDF '{path}' ({reason}); name a robot file") from None


def published_urdf(name: str) -> Path:
    """URDF of a published robot, of robot_descriptions first, else of example-robot-data."""
    module = _from_robot_descriptions(name)
    if module is not None:
        return module
    robots = _example_robots()
    names = {path.stem: path for path in reversed(robots)}
    if name in names:
        return names[name]
    folders = {path.parts[path.parts.index("robots") + 1] for path in robots}
    for folder in (name, f"{name}_description", f"{name}_data"):
        inside = [path for path in robots if folder in path.parts]
        if len(inside) == 1:
            return inside[0]
        if inside:
            listed = ", ".join(path.stem for path in inside)
            raise BuildError(f"'{name}' has several URDFs; choose --description from {listed}")
    if not robots:
        raise BuildError(
            "--description reads robot_descriptions or example-robot-data, and neither is "
            "installed; run: pip install robot_descriptions"
        )
    near = get_close_matches(name, [*names, *folders], n=5, cutoff=0.4) or sorted(names)[:12]
    raise BuildError(f"no installed package describes '{name}'; there are {', '.join(near)}, …")


def _from_robot_descriptions(name: str) -> Path | None:
    if not name.isidentifier():
        return None
    for module in (name, f"{name}_description"):
        try:
            described = import_module(f"robot_descriptions.{module}")
        except ModuleNotFoundError:
            continue
        except Exception as error:  # it downloads the robot when it is imported
            reason = " ".join(str(error).split())
            raise BuildError(f"robot_descriptions cannot load '{name}': {reason}") from None
        path = getattr(described, "URDF_PATH", None) or getattr(described, "MJCF_PATH", None)
        if path:
            return Path(path)
    return None


def _example_robots() -> list[Path]:
    """URDFs of example-robot-data, by path."""
    try:
        recorded = files("example-robot-data") or []
    except ModuleNotFoundError:  # the distribution is not installed
        return []
    paths = [Path(str(f.locate())) for f in recorded if _ROBOTS in str(f) and f.suffix == ".urdf"]
    return sorted(path for path in paths if path.is_file())
