"""The option --motions of `symgen excite`: several motions that share the duration."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer

from runtime.cli.common import say
from runtime.cli.given_options import given_options
from runtime.cli.motion_output import certified_stages, write_motion_log
from runtime.common.files import require_unused
from runtime.errors import RuntimeFault
from runtime.excitation import DesignSettings, Information, predict
from runtime.excitation.proof.certified_motion import certified, pulled_inside
from runtime.excitation.search.information import FRICTION
from runtime.excitation.search.several_motions import design_several, torque_sigma, with_motion
from runtime.excitation.trajectory_file import write_trajectory
from runtime.library import Library
from runtime.library.torque_units import common_unit, torque_units

Motions = Annotated[
    int,
    typer.Option(
        "--motions",
        metavar="K",
        help="Number of motions that share --duration, each designed with what those before it "
        "determine; written as NAME-1.json to NAME-K.json. symgen approach exports them.",
        min=1,
    ),
]
_EXCLUDED = ("document", "static", "until", "export", "from_pose", "returns", "pictures")
"""Parameters of one motion."""


@dataclass(frozen=True, slots=True)
class SeveralFiles:
    """Files of several motions.

    Attributes:
        path: JSON of --out, from which the names follow.
        rate: of the sampled motions, Hz.
        speeds: stages whose certificates are printed, shares of the designed speed.
        overwrite: value of --overwrite.
    """

    path: Path
    rate: float
    speeds: list[float]
    overwrite: bool

    def of_motion(self, k: int) -> Path:
        """JSON of motion K = 1, 2, …"""
        return self.path.with_name(f"{self.path.stem}-{k}.json")


def require_several(context: typer.Context, motions: int) -> None:
    """Refuse options of one motion beside --motions."""
    for name, option in given_options(context).items():
        if motions > 1 and name in _EXCLUDED:
            raise RuntimeFault(
                f"--motions writes one file per motion, to which {option} does not apply; "
                "leave it out (symgen approach plans the ways of a motion and exports it)"
            )


def excite_several(
    lib: Library,
    count: int,
    settings: DesignSettings,
    known: Information,
    files: SeveralFiles,
    **search: Any,
) -> None:
    """Design several motions, print what their logs will show together, and write them."""
    paths = [files.of_motion(k) for k in range(1, count + 1)]
    require_unused([p for one in paths for p in (one, one.with_suffix(".csv"))], files.overwrite)
    written = []
    designs = design_several(lib, settings, count, **search)
    unit = common_unit(torque_units(lib.manifest), "m")
    for k, (path, design) in enumerate(zip(paths, designs, strict=True), 1):
        optimum = replace(
            design, trajectory=pulled_inside(lib, design.trajectory, share=settings.margin)
        )
        expected = predict(lib, optimum.trajectory, known, known.friction or FRICTION)
        known = with_motion(lib, optimum.trajectory, known)
        write_trajectory(optimum, lib, path, expected)
        motion = certified(lib, optimum.trajectory, settings.safety)
        sentence = f"Designed by symgen, motion {k} of {count}."
        written += [path, write_motion_log(motion, files.rate, path.with_suffix(".csv"), sentence)]
        sigma = torque_sigma(lib, optimum.trajectory.home, known)
        say(
            f"motion {k}: {optimum.trajectory.duration:.4g} s; expected σ of the torque of motions "
            f"never seen, by the logs so far: {1e3 * sigma:.4g} {unit}"
        )
        certified_stages(motion, files.speeds)
    say(f"trajectories: {', '.join(map(str, written))}")
