"""Entry points of files: the file that is damaged, and the function that reads it."""

import contextlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import typer

from runtime.cli.export import export_command
from runtime.cli.inspect import inspect_command
from runtime.estimators.prior_file import read_prior
from runtime.estimators.regression import load_statistics
from runtime.excitation.trajectory_file import read_trajectory
from runtime.identification.comparison.run import read_truth
from runtime.identification.payload.arm import read_arm_model
from runtime.identification.payload.known import read_known_payload
from runtime.identification.several_logs.joint_fit import read_carried
from runtime.library import Library, load
from runtime.library.compile_recipe import read_recipe
from runtime.library.manifest import read_manifest
from runtime.outputs.viewer import look_of, read_motion
from runtime.recording import load_recipe, open_streamed, read_recording
from runtime.simulation import read_payload
from runtime.simulation.settings import settings_of
from scripts.fuzzing import data_sets, goods, models, readers
from scripts.fuzzing.readers import OUT, Reader


@dataclass(frozen=True, slots=True)
class Door:
    """A file that is damaged."""

    file: str  # its path in the folder
    furnish: Callable[[Path, Library], None]  # writes good files
    read: Reader  # what reads it; (folder of the files, the robot) → anything
    seal: Callable[[Path], None] | None = None  # renews digests
    programs: tuple[str, ...] = ()  # that the reader may start


def _log(file: str, furnish: Callable[[Path, Library], None], place: str = "") -> Door:
    where = place or file
    return Door(file, furnish, lambda folder, lib: read_recording(folder / where))


def _streamed(file: str, furnish: Callable[[Path, Library], None] | None = None) -> Door:
    def read(folder: Path, lib: Library) -> None:
        log = open_streamed(folder / file)
        for start in range(0, min(log.rows, 10**6), 2**16):
            log.block(start, start + 2**16)
        log.instants(range(0, log.rows, 50), 20)

    return Door(file, furnish or goods.Log(file), read)


def _doctor(file: str) -> Door:
    def read(folder: Path, lib: Library) -> None:
        with contextlib.suppress(typer.Exit):
            inspect_command(
                str(folder / file), robot=str(lib.folder), recipe_out=folder / OUT / "recipe.toml"
            )

    return Door(file, goods.Log(file, 300), read)


def _exported(form: str) -> Door:
    """Export one format; of several, complete ones would stay where another fails."""

    def read(folder: Path, lib: Library) -> None:
        export_command(folder, to=form, out=folder / OUT, robot=str(lib.folder), overwrite=True)

    return Door("result.json", goods.result, read)


def _optioned(name: str) -> Door:
    return Door("options.json", goods.options, readers.with_options(name))


def _study(file: str, seal: Callable[[Path], None] | None = None) -> Door:
    return Door(f"toy/{file}", goods.study, readers.experiments, seal)


def _visual(form: str) -> Door:
    def read(folder: Path, lib: Library) -> None:
        look_of(lib, folder / f"{form}.urdf")

    return Door(f"mesh.{form}", models.mesh, read)


def _collision(form: str) -> Door:
    return Door(f"mesh.{form}", models.mesh, readers.inspected(f"{form}.urdf"))


DOORS: dict[str, Door] = {
    # Logs.
    "csv": _log("log.csv", goods.Log("log.csv")),
    "csv-gz": _log("log.csv.gz", goods.zipped),
    "npz": _log("log.npz", goods.Log("log.npz")),
    "parquet": _log("log.parquet", goods.Log("log.parquet")),
    "hdf5": _log("log.h5", data_sets.hdf5),
    "matlab": _log("log.mat", data_sets.hdf5),
    "stream-hdf5": _streamed("log.h5", data_sets.hdf5),
    "lerobot": _log("meta/info.json", data_sets.lerobot, "."),
    "lerobot-frames": _log("data/chunk-000/file-000.parquet", data_sets.lerobot, "."),
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
    "headless": Door("log.csv", goods.headless, readers.headless),
    "recipe": Door("recipe.toml", goods.recipe, lambda f, _: load_recipe(f / "recipe.toml")),
    # Models.
    "urdf": Door("robot.urdf", models.urdf, readers.urdf),
    "inspect": Door("robot.urdf", models.urdf, readers.inspected("robot.urdf")),
    "repair": Door("robot.urdf", models.urdf, readers.repair),
    "mjcf": Door("robot.xml", models.mjcf, readers.inspected("robot.xml")),
    "stl": _collision("stl"),
    "obj": _collision("obj"),
    "dae": _collision("dae"),
    "view-urdf": Door("robot.urdf", models.urdf, lambda f, lib: look_of(lib, f / "robot.urdf")),
    "view-stl": _visual("stl"),
    "view-obj": _visual("obj"),
    "view-dae": _visual("dae"),
    "robot": Door("robot.toml", models.robot_config, readers.robot),
    "mechanism": Door("mechanism.toml", models.mechanism, readers.mechanism),
    "dh": Door("rows.toml", models.dh, readers.built("rows.toml")),
    "build-mjcf": Door("robot.xml", models.mjcf, readers.built("robot.xml")),
    "build-sdf": Door("robot.sdf", models.sdf, readers.built("robot.sdf")),
    "build-xacro": Door("robot.xacro", models.xacro, readers.xacro, programs=(sys.executable,)),
    "masses": Door("masses.toml", models.masses, readers.masses),
    # Generated folders.
    "manifest": Door(
        "manifest.json", goods.generated, lambda f, _: read_manifest(f / "manifest.json")
    ),
    "library": Door("manifest.json", goods.generated, lambda folder, _: load(folder)),
    "request": Door("manifest.json", goods.generated, readers.request),
    "compile": Door("compile.json", goods.generated, lambda folder, _: read_recipe(folder)),
    "build": Door("build.json", goods.generated, lambda folder, _: load(folder)),
    # What else is known of a robot.
    "prior": Door("prior.toml", goods.prior, lambda f, lib: read_prior(f / "prior.toml", lib)),
    "fleet": Door("fleet.toml", goods.fleet, lambda f, lib: read_prior(f / "fleet.toml", lib)),
    "fleet-unit": Door("units/u0/statistics.npz", goods.units, readers.fleet),
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
        readers.all_of(
            lambda f, _: read_known_payload(str(f / "payload.json")),
            lambda f, lib: read_carried(f / "payload.json", lib),
        ),
    ),
    # Motions.
    "trajectory": Door(
        "motion.json", goods.trajectory, lambda f, lib: read_trajectory(f / "motion.json", lib)
    ),
    "loop": Door("loop.toml", goods.trajectory, readers.looped),
    "film": Door(
        "motion.json", goods.trajectory, lambda f, lib: read_motion(str(f / "motion.json"), lib)
    ),
    "predict": Door("motion.json", goods.trajectory, readers.predicted),
    "simulate": Door("motion.json", goods.trajectory, readers.simulated),
    # Results.
    "evaluate": Door("result.json", goods.result, readers.evaluated),
    "friction": Door("result.json", goods.result, readers.renewed),
    "export": _exported("urdf"),
    "export-friction": _exported("friction"),
    "arm": Door("result.json", goods.result, read_arm_model),
    "report": Door("result.json", goods.result, readers.reported),
    "predictions": Door("predictions.npz", goods.result, readers.reported),
    "compare": Door("compare.json", goods.comparison, readers.reported),
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
    "trials": _study("trials.parquet", readers.renew_digests),
    "series": _study("series.npz", readers.renew_digests),
    "chunk": Door("toy/trials.parquet", goods.study, readers.rows),
}
