"""Build of a robot in memory: a `pinocchio.Model`, a `mujoco.MjSpec` or the text of a file."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from symgen.chain import ChainOptions
from symgen.errors import BuildError
from symgen.make import bundled_robots
from symgen.make.compiler import levels_of_processor
from symgen.make.pipeline import BuildResult
from symgen.make.pipeline import build as build_request
from symgen.make.request import BuildRequest
from symgen.sources import Source, read_source, split_by_use
from symgen.sources.mjcf import robot_of_compiled
from symgen.sources.pinocchio_model import urdf_of_model


def build(
    model: Any,
    *,
    name: str,
    out: str | Path = "generated",
    options: ChainOptions | None = None,
    force: bool = False,
) -> BuildResult:
    """Generate and compile the library of a robot in memory, as `symgen build` does of a file.

    Of a `pinocchio.Model`, gravity and the limits of joints are taken, a free flyer at the root is
    the free base, and fixed links have become part of the moving ones. Of a `mujoco.MjSpec`,
    bodies, joints, couplings, loops and springs are taken as from a file. Friction, damping and
    rotors are left to the identification.

    Args:
        model: `pinocchio.Model`, `mujoco.MjSpec`, or the text of a URDF, MJCF or SDF file.
        name: of the folder and prefix of the C functions: a-z, 0-9, _.
        out: folder of generated folders.
        options: base, tip, locked joints, gravity, free base and others; None is the model's.
        force: rebuild even if the folder is up to date.

    Returns:
        The generated `folder`, which `runtime.load` takes, and `notes`.

    Raises:
        SymgenError: a model of another kind, a joint or body that cannot be built, or the name of
            a bundled robot.
    """
    if not isinstance(out, str | Path):
        raise BuildError(f"expected a folder for out, got {out!r:.60}")
    if name in bundled_robots():
        raise BuildError(f"'{name}' is the name of a bundled robot; choose another name")
    chosen, notes = options or ChainOptions(), list[str]()
    kind, package = type(model).__name__, type(model).__module__.partition(".")[0]
    if isinstance(model, str):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, f"{name}.urdf")
            path.write_text(model, encoding="utf-8")
            has_gravity = chosen.gravity is not None
            urdf, mechanism = read_source(Source(path), chosen.mechanism, notes.append, has_gravity)
    elif (package, kind) == ("mujoco", "MjSpec"):
        compiled, has_gravity = model.copy().compile(), chosen.gravity is not None
        place = f"the specification of '{name}'"
        urdf, mechanism = robot_of_compiled(compiled, name, None, has_gravity, notes.append, place)
    elif (package, kind) == ("pinocchio", "Model"):
        urdf, floats = urdf_of_model(model)
        x, y, z = map(float, model.gravity.linear)
        free, gravity = floats or chosen.floating, chosen.gravity or (x, y, z)
        chosen, mechanism = replace(chosen, gravity=gravity, floating=free), chosen.mechanism
    else:
        raise BuildError(
            "expected a pinocchio.Model, a mujoco.MjSpec or the text of a URDF, MJCF or SDF file, "
            f"got {model!r:.60}"
        )
    of_file = tuple(s for s in mechanism.spring if s not in chosen.mechanism.spring)
    kept, _ = split_by_use(urdf, replace(chosen, mechanism=mechanism), of_file)
    stated = tuple(s for s in mechanism.spring if s not in of_file)
    chosen = replace(chosen, mechanism=mechanism.replace(spring=(*stated, *kept)))
    done = build_request(BuildRequest(name, urdf, chosen), Path(out), force, levels_of_processor())
    return replace(done, notes=(*notes, *done.notes))
