"""Options of `symgen excite`: search, files, unknowns."""

from typing import Annotated

import typer

from runtime.cli.common import sentences_of
from runtime.excitation.motion_export import MOTION_FORMATS
from runtime.excitation.search.information import FRICTION

Processes = Annotated[
    int | None,
    typer.Option(
        help="Number of parallel processes; default one per core, 1 for few starts (fewer than "
        "4, with --document 10)."
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="tcp://HOST:PORT",
        help="Search on the workers of this dask cluster instead (pip install "
        "'symgen\\[cluster]'). Each worker loads the robot's folder, so it needs the same file "
        "system.",
    ),
]
ExportRate = Annotated[
    float | None,
    typer.Option(
        help="Rate of the rows of files, Hz; default 1000, for ros 25. libfranka has 1000 Hz "
        "always."
    ),
]
Export = Annotated[
    list[str] | None,
    typer.Option(
        metavar="FORMAT",
        help="Files for a robot, written only if the certificate holds; repeatable. "
        f"{sentences_of(MOTION_FORMATS)}.",
    ),
]
Speed = Annotated[
    list[float] | None,
    typer.Option(
        help="Speed of a stage in % of the designed speed, on the same path; "
        "repeatable, each with its own certificate: 10, 50 and 100 are three stages to try on "
        "a robot. File names end in -speed10. Default 100."
    ),
]
Document = Annotated[
    bool,
    typer.Option(
        "--document",
        help="Problem of the document: criterion cond, limits of position, velocity and "
        "acceleration only. Such a motion can hit the table that an FR3 stands on.",
    ),
]
FrictionColumns = Annotated[
    str | None,
    typer.Option(
        metavar="COLUMNS",
        help="Friction columns that are estimated too, with commas, or none; default "
        f"{','.join(FRICTION)}, with --payload-only offset. All criteria but the document's "
        "cond count them.",
    ),
]
Home = Annotated[
    str | None,
    typer.Option(
        metavar="Q",
        help="Start and end position, one number per joint with commas, rad or m; default the "
        "home of the robot.",
    ),
]
Pictures = Annotated[
    bool,
    typer.Option(
        "--pictures",
        help="Write PNG files beside the JSON: motion and torque of every joint with limits, "
        "velocity over position (-speed), path of the tip and distances (-space).",
    ),
]
