"""Parts that the commands share: options and folders."""

from pathlib import Path
from typing import Annotated

import typer

from runtime.common.settings import data_option, model_option, output_option
from runtime.common.terminal import completing
from runtime.common.user_builds import generated_here
from symgen.errors import BuildError

RootOption = Annotated[
    Path, output_option("--out", help="Folder with one subfolder per robot.", show_default=True)
]


def robots(incomplete: str) -> list[str]:
    """Names of generated robots that begin so."""
    return completing([folder.name for folder in generated_here()])(incomplete)


RobotArgument = Annotated[
    str | None,
    typer.Argument(autocompletion=robots, help="Name of a robot. Default: all in the folder."),
]
BaseOption = Annotated[
    str | None, model_option(help="Link that is fixed to the world. Default: the root link.")
]
TipOption = Annotated[
    str | None,
    model_option(help="Last link of the chain; links beyond it are removed. Default: all links."),
]
LockOption = Annotated[
    list[str] | None,
    model_option(metavar="JOINT=VALUE", help="Fix a joint at a position in rad or m; repeatable."),
]
ArgumentOption = Annotated[
    list[str] | None,
    data_option(
        "--arg", metavar="NAME=VALUE", help="Value of an argument of a xacro file; repeatable."
    ),
]
ModelOption = Annotated[
    str | None,
    data_option(
        "--model",
        metavar="NAME",
        help="Robot of a file that has several: model of SDF, body of the world of MJCF, root link "
        "of a URDF.",
    ),
]
PackageOption = Annotated[
    list[Path] | None,
    data_option(
        metavar="DIR",
        help="Folder of a ROS package, or of several, for package:// and $(find …); repeatable. "
        "ROS_PACKAGE_PATH and AMENT_PREFIX_PATH are searched too.",
        file_okay=False,
    ),
]
MechanismOption = Annotated[
    Path | None,
    model_option(
        metavar="FILE",
        help="TOML file of a mechanism: couplings ([\\[coupling]]), loops ([\\[loop]]), springs "
        "([\\[spring]]), torque curves and further friction.",
        dir_okay=False,
    ),
]
ConfigOption = Annotated[
    list[Path] | None,
    data_option(
        help="TOML file with home, limits, braking, proxies, pairs; repeatable.", dir_okay=False
    ),
]
OverwriteOption = Annotated[bool, output_option("--overwrite", help="Replace files that exist.")]


def read_locks(items: list[str]) -> dict[str, float]:
    """Return the values of --lock JOINT=VALUE by joint, rad or m."""
    locks = {}
    for item in items:
        joint, _, value = item.partition("=")
        try:
            locks[joint] = float(value)
        except ValueError:
            raise BuildError(f"--lock needs JOINT=VALUE with a number, got '{item}'") from None
    return locks


def read_arguments(items: list[str]) -> dict[str, str]:
    """Return the values of --settings arg=NAME=VALUE by name."""
    arguments = {}
    for item in items:
        name, mark, value = item.partition("=")
        if not name or not mark:
            raise BuildError(f"the setting arg needs NAME=VALUE, got '{item}'")
        arguments[name] = value
    return arguments


def folders_of(out: Path, robot: str | None) -> list[Path]:
    """Folder of one generated robot, or of all."""
    if robot is not None:
        if not (out / robot / "manifest.json").exists():
            raise BuildError(
                f"'{out / robot}' contains no generated robot; python -m symgen list names those "
                f"that are there, and build --urdf FILE --name {robot} makes it"
            )
        return [out / robot]
    return sorted(f for f in out.glob("[a-z]*/") if (f / "manifest.json").exists())
