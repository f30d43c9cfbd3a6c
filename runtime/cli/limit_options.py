"""Options of the limits that a motion keeps, shared by the commands that plan motions."""

from pathlib import Path
from typing import Annotated

import typer

from runtime.cli.carry import CARRY
from runtime.excitation.limits.distances import TABLE_MARGIN

Table = Annotated[
    str | None,
    typer.Option(
        metavar="Z",
        help="Height of a table that the arm stays above, m in the base frame; none where "
        "there is no table. --export needs one of both.",
    ),
]
Unchecked = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LIMIT",
        help="Limit that --export may leave unchecked; repeatable: self-collision, table, "
        "carried-body, springs-of-unknown-stiffness; with --document torque, "
        "position-dependent-velocity, torque-rate and tip-speed too; all for every one.",
    ),
]
Box = Annotated[
    str | None,
    typer.Option(
        metavar="BOX",
        help="XMIN,XMAX,YMIN,YMAX,ZMIN,ZMAX of a box that the tip stays in, m in the base "
        "frame; inf leaves a side open.",
    ),
]
Clearance = Annotated[
    float | None,
    typer.Option(
        help="Least distance between links, above the table and from obstacles, m; default the "
        f"margins of the robot, {TABLE_MARGIN:g} above the table and from obstacles."
    ),
]
Carry = Annotated[str | None, typer.Option(metavar="BODY", help=CARRY)]
Obstacles = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="TOML of obstacles that the links keep away from: tables [\\[obstacle]] with name, "
        "center, size (edges), rpy and radius, m and rad in the base frame.",
    ),
]
PayloadBand = Annotated[
    str | None,
    typer.Option(
        metavar="MASS,REACH",
        help="The limits of torques hold for every payload that differs from --carry, or from an "
        "empty hand, by masses of ± MASS kg in all within REACH m of its centre, or of the tip.",
    ),
]
FrictionBand = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT",
        help="The limits of torques hold for --viscous and --coulomb ± PERCENT of both.",
    ),
]
ModelBand = Annotated[
    str | None,
    typer.Option(
        metavar="TRUST",
        help="The limits of torques hold for all link parameters within the 95 % intervals of the "
        "inertial prior around the URDF: cad, gripper, none, or the trust κ itself.",
    ),
]
TorqueFraction = Annotated[
    float, typer.Option(help="Fraction of the torque limits that the motion may use, 0 to 1.")
]
Viscous = Annotated[
    str | None,
    typer.Option(
        metavar="FV",
        help="Viscous friction in the torque limits, N·m·s/rad or N·s/m: one number or one per "
        "joint with commas; default 0.",
    ),
]
Coulomb = Annotated[
    str | None,
    typer.Option(
        metavar="FC",
        help="Coulomb friction in the torque limits, N·m or N: one number or one per joint with "
        "commas; default 0.",
    ),
]
