"""`symgen view`."""

import webbrowser
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from runtime.cli.common import open_robot
from runtime.cli.log_options import LogChoices
from runtime.common.files import require_unused, write_text
from runtime.common.settings import argument_field, data_field, method_field, output_field
from runtime.common.terminal import say
from runtime.outputs.viewer.player import FRAME_S, Player, Scene, read_motion
from runtime.outputs.viewer.shapes import look_of


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewSettings(LogChoices):
    """Settings of `symgen view`."""

    options = "robot urdf html overwrite"
    motion: str = argument_field(metavar="MOTION", help="A motion of excite (.json), or a log.")
    urdf: Path | None = data_field(
        metavar="FILE", help="URDF with visual meshes; default that of the generated robot."
    )
    package_dir: list[Path] | None = data_field(
        metavar="DIR", help="Folder that holds the package:// of the meshes; repeatable."
    )
    port: int = output_field(8080, help="Port of the server; if it is used, the next one.")
    no_open: bool = method_field(False, help="Do not open a browser.")
    html: Path | None = output_field(
        metavar="FILE", help="Write the animation as one HTML file instead of serving it."
    )


def view_command(given: ViewSettings) -> None:
    r"""Show the moving robot in a web browser.

    \b
    symgen view fr3_simulated --robot fr3
    symgen view log.csv --urdf fr3.urdf --settings package_dir=~/franka_description

    The page plays the motion with the limits of position, velocity and torque. Links are drawn by
    the visual meshes of the URDF, else by collision capsules, else by solids between the joints.
    Ctrl-C ends the server.
    """
    lib = open_robot(given.robot, given.yes)
    require_unused([given.html] if given.html else [], given.overwrite, "--html")
    played = read_motion(given.motion, lib, given.recipe, given.run)
    look = look_of(lib, given.urdf, given.package_dir or ())
    scene = Scene(lib, look, given.port)
    try:
        scene.trace(played.q)
        say(f"drawn:  {look.sentence}")
        if given.html is not None:
            times = np.arange(0.0, played.duration + FRAME_S / 2, FRAME_S)
            write_text(given.html, scene.film(np.array([played.at(float(t))[0] for t in times])))
            say(f"film:   {given.html}")
            return
        say(f"viewer: {scene.url} (Ctrl-C ends it)")
        if not given.no_open:
            webbrowser.open(scene.url)
        Player(lib, scene, played).run()
    except KeyboardInterrupt:
        say("ended")
    finally:
        scene.close()
