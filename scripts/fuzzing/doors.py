"""Entry points of files: the file that is damaged, and the function that reads it."""

import contextlib
import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from runtime.cli import app_of
from runtime.cli.evaluate import evaluate_command
from runtime.cli.export import export_command
from runtime.cli.inspect import inspect_command
from runtime.cli.predict import predict_command
from runtime.cli.simulate import simulate_command
from runtime.errors import RuntimeFault
from runtime.estimators.prior_file import read_prior
from runtime.estimators.regression import load_statistics
from runtime.excitation.trajectory_file import read_trajectory
from runtime.experiments.storage.chunks import read_rows
from runtime.identification.comparison.truth import read_truth
from runtime.identification.payload import read_arm_model, read_known_payload
from runtime.identification.several_logs.joint_fit import read_carried
from runtime.library import Library, load
from runtime.library.compile_recipe import read_recipe
from runtime.library.manifest import read_manifest
from runtime.outputs.report import write_report
from runtime.outputs.report.experiments import write_experiments
from runtime.outputs.viewer import look_of, read_motion
from runtime.recording import load_recipe, open_streamed, read_recording
from runtime.simulation import read_payload
from runtime.simulation.controller_file import read_controller
from runtime.simulation.settings import settings_of
from scripts.fuzzing import goods

Reader = Callable[[Path, Library], Any]
OUT = "out"
"""Name of the only folder in which a command may write."""


@dataclass(frozen=True, slots=True)
class Door:
    """A file that is damaged.

    Attributes:
        file: its path in the folder.
        furnish: writes good files.
        read: what reads it; (folder of the files, the robot) → anything.
        seal: called after the damage, for files that vouch for others by digest.
    """

    file: str
    furnish: Callable[[Path, Library], None]
    read: Reader
    seal: Callable[[Path], None] | None = None


def _log(file: str, furnish: Callable[[Path, Library], None], place: str = "") -> Door:
    where = place or file
    return Door(file, furnish, lambda folder, lib: read_recording(folder / where))


def _streamed(file: str) -> Door:
    def read(folder: Path, lib: Library) -> None:
        log = open_streamed(folder / file)
        for start in range(0, min(log.rows, 10**6), 2**16):
            log.block(start, start + 2**16)
        log.instants(range(0, log.rows, 50), 20)

    return Door(file, goods.Log(file), read)


def _all(*readers: Reader) -> Reader:
    """Call every reader, and raise the first fault after all have run."""

    def read(folder: Path, lib: Library) -> None:
        faults = []
        for each in readers:
            try:
                each(folder, lib)
            except RuntimeFault as fault:
                faults.append(fault)
        if faults:
            raise faults[0]

    return read


def _urdf(folder: Path, _: Library) -> None:
    from symgen.chain import read_chain
    from symgen.cli.common import read_urdf

    read_chain(read_urdf(folder / "robot.urdf"))


def _inspected(file: str) -> Reader:
    def read(folder: Path, _: Library) -> None:
        from symgen.inspect import inspect_file

        inspect_file(folder / file)

    return read


def _repaired(folder: Path, _: Library) -> None:
    from symgen.inspect import inspect_file, repaired

    repaired(inspect_file(folder / "robot.urdf", with_base=False), folder / "robot.urdf")


def _robot(folder: Path, _: Library) -> None:
    from symgen.build.config import read_config

    read_config(folder / "robot.toml")


def _request(folder: Path, _: Library) -> None:
    from symgen.build.request import request_from_folder

    request_from_folder(folder)


def _doctor(file: str) -> Door:
    def read(folder: Path, lib: Library) -> None:
        with contextlib.suppress(typer.Exit):
            inspect_command(
                str(folder / file),
                robot=str(lib.folder),
                recipe_out=folder / OUT / "recipe.toml",
            )

    return Door(file, goods.Log(file, 300), read)


def _evaluated(folder: Path, lib: Library) -> None:
    evaluate_command(folder, str(folder / "log.csv"), robot=str(lib.folder), as_json=True)


def _exported(form: str) -> Door:
    """Export one format; of several, complete ones would stay where another fails."""

    def read(folder: Path, lib: Library) -> None:
        export_command(folder, to=form, out=folder / OUT, robot=str(lib.folder), overwrite=True)

    return Door("result.json", goods.result, read)


def _reported(folder: Path, _: Library) -> None:
    write_report(folder, folder / OUT / "report.html")


def _experiments(folder: Path, _: Library) -> None:
    write_experiments(folder, folder / OUT / "report.html", tables_to=folder / OUT / "tables.md")


def _vouch(folder: Path) -> None:
    """Write the present digests of the other files into result.json."""
    path = folder / "toy" / "result.json"
    facts = json.loads(path.read_text())
    for name in ("trials.parquet", "series.npz"):
        if (folder / "toy" / name).is_file() and not (folder / "toy" / name).is_symlink():
            data = (folder / "toy" / name).read_bytes()
            facts["files"][name] = hashlib.sha256(data).hexdigest()
    path.write_text(json.dumps(facts))


def _predicted(folder: Path, lib: Library) -> None:
    predict_command(str(folder / "motion.json"), robot=str(lib.folder), noise="0.05", as_json=True)


def _simulated(folder: Path, lib: Library) -> None:
    class Typed:
        """Context of a command line with the robot and the motion only."""

        def get_parameter_source(self, _: str) -> None:
            """No option is given."""

    out = folder / OUT / "log.csv"
    simulate_command(
        Typed(),  # type: ignore[arg-type]
        robot=str(lib.folder),
        trajectory=folder / "motion.json",
        out=out,
        keep_every=10,
    )


def _looped(folder: Path, lib: Library) -> None:
    loop = read_controller(folder / "loop.toml", lib)
    loop.simulate(lib, lib.pi0, {}, np.linspace(loop.start, loop.start + 1.0, 50))


_FILES: dict[str, tuple[str, ...]] = {
    "identify": ("log.csv", "--out", "{folder}/out/result"),
    "excite": ("--document", "--out", "{folder}/out/motion.json"),
    "simulate": ("--trajectory", "motion.json", "--ideal", "--out", "{folder}/out/log.csv"),
    "predict": ("motion.json",),
}
"""Words of commands that stay as they are."""


def _optioned(name: str) -> Door:
    """A command with the values of options.json; names of options and of files are not damaged."""

    def read(folder: Path, lib: Library) -> None:
        try:
            given = json.loads((folder / "options.json").read_text())[name]
            values = {option: str(given[option]) for option in goods.OPTIONS[name]}
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            raise RuntimeFault("no options") from None
        words = [
            name,
            *(each.format(folder=folder) for each in _FILES[name]),
            "--robot",
            str(lib.folder),
        ]
        words += [f"{option}={value}" for option, value in values.items()]
        with contextlib.chdir(folder):
            try:
                app_of([name])(words)
            except SystemExit as end:
                if end.code:
                    raise RuntimeFault("a value that is no number of the option") from None

    return Door("options.json", goods.options, read)


def _headless(folder: Path, lib: Library) -> None:
    with contextlib.suppress(typer.Exit):
        inspect_command(str(folder / "log.csv"), robot=str(lib.folder))


def _masses(folder: Path, _: Library) -> None:
    from symgen.build.config import read_masses
    from symgen.chain import ChainOptions, read_chain
    from symgen.cli.common import read_urdf

    options = ChainOptions(masses=read_masses(folder / "masses.toml"))
    read_chain(read_urdf(folder / "robot.urdf"), options)


def _study(file: str, seal: Callable[[Path], None] | None = None) -> Door:
    return Door(f"toy/{file}", goods.study, _experiments, seal)


def _visual(form: str) -> Door:
    def read(folder: Path, lib: Library) -> None:
        look_of(lib, folder / f"{form}.urdf")

    return Door(f"mesh.{form}", goods.mesh, read)


def _collision(form: str) -> Door:
    return Door(f"mesh.{form}", goods.mesh, _inspected(f"{form}.urdf"))


def _rows(folder: Path, _: Library) -> None:
    read_rows(folder / "toy" / "trials.parquet", goods.MARK)


DOORS: dict[str, Door] = {
    # Logs.
    "csv": _log("log.csv", goods.Log("log.csv")),
    "csv-gz": _log("log.csv.gz", goods.zipped),
    "npz": _log("log.npz", goods.Log("log.npz")),
    "parquet": _log("log.parquet", goods.Log("log.parquet")),
    "mcap": _log("log.mcap", goods.mcap),
    "cdr": _log("log.cdr.mcap", goods.mcap),
    "ros1": _log("log.bag", goods.ros1),
    "ros2": _log("bag/bag.db3", goods.Ros2(), "bag"),
    "db3": _log("bag/bag.db3", goods.Ros2()),
    "ros2-yaml": _log("bag/metadata.yaml", goods.Ros2(), "bag"),
    "ros2-packed": _log("bag/bag.db3", goods.Ros2("MESSAGE"), "bag"),
    "ros2-zstd": _log("bag/bag.db3.zstd", goods.Ros2("FILE"), "bag"),
    "libfranka": _log("log.csv", goods.franka),
    "folder": _log("recipe.toml", goods.recipe, "."),
    "stream-csv": _streamed("log.csv"),
    "stream-npz": _streamed("log.npz"),
    "stream-parquet": _streamed("log.parquet"),
    "doctor-csv": _doctor("log.csv"),
    "doctor-npz": _doctor("log.npz"),
    "headless": Door("log.csv", goods.headless, _headless),
    "recipe": Door("recipe.toml", goods.recipe, lambda f, _: load_recipe(f / "recipe.toml")),
    # Models.
    "urdf": Door("robot.urdf", goods.urdf, _urdf),
    "inspect": Door("robot.urdf", goods.urdf, _inspected("robot.urdf")),
    "repair": Door("robot.urdf", goods.urdf, _repaired),
    "mjcf": Door("robot.xml", goods.mjcf, _inspected("robot.xml")),
    "stl": _collision("stl"),
    "obj": _collision("obj"),
    "dae": _collision("dae"),
    "view-urdf": Door("robot.urdf", goods.urdf, lambda f, lib: look_of(lib, f / "robot.urdf")),
    "view-stl": _visual("stl"),
    "view-obj": _visual("obj"),
    "view-dae": _visual("dae"),
    "robot": Door("robot.toml", goods.robot_config, _robot),
    "masses": Door("masses.toml", goods.masses, _masses),
    # Generated folders.
    "manifest": Door(
        "manifest.json", goods.generated, lambda f, _: read_manifest(f / "manifest.json")
    ),
    "library": Door("manifest.json", goods.generated, lambda folder, _: load(folder)),
    "request": Door("manifest.json", goods.generated, _request),
    "compile": Door("compile.json", goods.generated, lambda folder, _: read_recipe(folder)),
    "build": Door("build.json", goods.generated, lambda folder, _: load(folder)),
    # What else is known of a robot.
    "prior": Door("prior.toml", goods.prior, lambda f, lib: read_prior(f / "prior.toml", lib)),
    "virtual": Door(
        "settings.toml", goods.virtual, lambda f, lib: settings_of(lib, f / "settings.toml")
    ),
    "box": Door(
        "box.toml", goods.virtual, lambda f, lib: read_payload(str(f / "box.toml")).pi(lib)
    ),
    "truth": Door(
        "log.truth.json", goods.truth, lambda f, lib: read_truth(f / "log.truth.json", lib)
    ),
    "payload": Door(
        "payload.json",
        goods.payload,
        _all(
            lambda f, _: read_known_payload(str(f / "payload.json")),
            lambda f, lib: read_carried(f / "payload.json", lib),
        ),
    ),
    # Motions.
    "trajectory": Door(
        "motion.json", goods.trajectory, lambda f, lib: read_trajectory(f / "motion.json", lib)
    ),
    "loop": Door("loop.toml", goods.trajectory, _looped),
    "film": Door(
        "motion.json", goods.trajectory, lambda f, lib: read_motion(str(f / "motion.json"), lib)
    ),
    "predict": Door("motion.json", goods.trajectory, _predicted),
    "simulate": Door("motion.json", goods.trajectory, _simulated),
    # Results.
    "evaluate": Door("result.json", goods.result, _evaluated),
    "export": _exported("urdf"),
    "export-friction": _exported("friction"),
    "arm": Door("result.json", goods.result, read_arm_model),
    "report": Door("result.json", goods.result, _reported),
    "predictions": Door("predictions.npz", goods.result, _reported),
    "compare": Door("compare.json", goods.comparison, _reported),
    "statistics": Door(
        "statistics.npz",
        goods.statistics,
        lambda f, lib: load_statistics(f / "statistics.npz", lib),
    ),
    # Options of commands.
    **{f"options-{name}": _optioned(name) for name in goods.OPTIONS},
    # Experiments.
    "study": _study("result.json"),
    "study-config": _study("config.json"),
    "trials": _study("trials.parquet", _vouch),
    "series": _study("series.npz", _vouch),
    "chunk": Door("toy/trials.parquet", goods.study, _rows),
}
