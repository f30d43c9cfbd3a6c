"""Entry points of files: the file that is damaged, good ones beside it, and what reads it."""

import contextlib
import hashlib
import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from runtime.cli import app
from runtime.common.child import Limits
from runtime.common.files import json_of
from runtime.errors import RuntimeFault
from runtime.estimators.literature.iv_didim import read_controller
from runtime.estimators.prior_file import read_prior
from runtime.excitation.motion.trajectory import read_trajectory
from runtime.experiments.report import write_experiments
from runtime.experiments.storage import read_rows
from runtime.identification.comparison.run import read_truth
from runtime.identification.kept_links import identify_friction
from runtime.identification.payload.arm_error import read_arm_model
from runtime.identification.payload.body import read_known_payload
from runtime.identification.saved_result import read_result
from runtime.identification.several_logs import read_carried
from runtime.library import Library, load
from runtime.library.compile_cache import read_recipe
from runtime.library.manifest import read_manifest
from runtime.outputs.report.report import write_report
from runtime.outputs.viewer.player import read_motion
from runtime.outputs.viewer.shapes import look_of
from runtime.recording import read_recording
from runtime.recording.recipes.recipe_file import load_recipe
from runtime.recording.streamed import open_streamed
from runtime.simulation import read_payload
from runtime.simulation.settings import settings_of
from scripts.fuzzing import goods
from symgen.chain import ChainOptions, read_chain
from symgen.chain.mechanism import Mechanism
from symgen.cli.make import read_mechanism
from symgen.inspect.inspection import inspect_file, repaired
from symgen.make.config import read_config, read_masses
from symgen.make.request import request_from_folder
from symgen.ros.packages import Packages, expanded
from symgen.sources import Source, read_source, urdf_text

Furnish = Callable[[Path, Library], None]
Reader = Callable[[Path, Library], Any]
"""(damaged file, robot) → anything."""
REFUSED = 2  # exit code
OUT = "out"  # name of the only folder in which a command may write


@dataclass(frozen=True, slots=True)
class Door:
    """A file that is damaged."""

    file: str  # its path in the folder
    furnish: Furnish  # writes good files into a folder
    read: Reader
    seal: Callable[[Path], None] | None = None  # renews digests of a folder
    programs: tuple[str, ...] = ()  # that the reader may start
    offered: tuple[str, ...] = ()  # names of files that a refusal may leave, to be filled in


def _alone(read: Callable[[Any], Any]) -> Reader:
    """A reader that needs no robot."""
    return lambda path, _: read(path)


def _folder(read: Callable[[Path], Any]) -> Reader:
    """A reader of the folder of the file."""
    return lambda path, _: read(path.parent)


def _beside(name: str, read: Reader) -> Reader:
    """A reader of another file of the folder."""
    return lambda path, lib: read(path.with_name(name), lib)


def _run(place: Path, lib: Library, words: str, *more: str) -> None:
    """Run a command in a folder; findings are no refusal, what the command line refuses is."""
    command = [each.format(folder=place) for each in words.split()]
    with contextlib.chdir(place):
        try:
            app([*command, "--robot", str(lib.folder), *more])
        except SystemExit as end:
            if end.code == REFUSED:
                raise RuntimeFault("a value that is no number of the option") from None


def _command(words: str) -> Reader:
    """A command that reads the file in its folder."""
    return lambda path, lib: _run(path.parent, lib, words)


def _streamed(path: Path, _: Library) -> None:
    log = open_streamed(path)
    for start in range(0, min(log.rows, 10**6), 2**16):
        log.block(start, start + 2**16)
    log.instants(range(0, log.rows, 50), 20)


def _chain(path: Path, _: Library) -> None:
    read_chain(urdf_text(path))


def _model(path: Path, _: Library) -> None:
    """What `symgen build --urdf FILE` reads, as a chain."""
    text, mechanism = read_source(Source(path), Mechanism())
    read_chain(text, ChainOptions(mechanism=mechanism))


def _mechanism(path: Path, _: Library) -> None:
    options = ChainOptions(mechanism=read_mechanism(path))
    read_chain(urdf_text(path.with_name("robot.urdf")), options)


def _masses(path: Path, _: Library) -> None:
    read_chain(urdf_text(path.with_name("robot.urdf")), ChainOptions(masses=read_masses(path)))


def _xacro(path: Path, _: Library) -> None:
    """Expanded in a process of little time."""
    limits = Limits(seconds=1, patience=60.0, memory=2**28)
    read_chain(expanded(path, {}, Packages(), limits))


def _payload(path: Path, lib: Library) -> None:
    """Both readers of a payload; the first fault after both have run."""
    faults = []
    for read in (lambda: read_known_payload(str(path)), lambda: read_carried(path, lib)):
        try:
            read()
        except RuntimeFault as fault:
            faults.append(fault)
    if faults:
        raise faults[0]


def _fleet(path: Path, lib: Library) -> None:
    place = path.parents[2]
    (place / OUT).mkdir(exist_ok=True)
    try:
        _run(place, lib, "fleet units --out {folder}/out/fleet.toml")
    finally:  # parts of a run that ended early are kept on purpose
        shutil.rmtree(place / OUT / "fleet.toml.parts", ignore_errors=True)


def _controlled(path: Path, lib: Library) -> None:
    """A controller file, simulated for a second."""
    loop = read_controller(path, lib)
    loop.simulate(lib, lib.pi0, {}, np.linspace(loop.start, loop.start + 1.0, 50))


def _renewed(path: Path, lib: Library) -> None:
    """Friction of a log with the links of a result."""
    log = read_recording(str(path.with_name("log.csv")))
    identify_friction(log, lib, read_result(path.parent))


def _reported(path: Path, _: Library) -> None:
    write_report(path.parent, path.parent / OUT / "report.html")


_SIMULATE = "simulate --trajectory motion.json --out {folder}/out/log.csv"
_EXPORT = "export {folder} --out {folder}/out --to "
"""Of one format; of several, complete ones would stay where another fails."""
_WORDS = {
    "identify": "identify log.csv --out {folder}/out/result",
    # Many starts are honest work; how workers send results to the command is not what is damaged.
    "excite": "excite --settings document=true --settings processes=1 --budget 2 "
    "--out {folder}/out/motion.json",
    "simulate": f"{_SIMULATE} --ideal",
    "predict": "predict motion.json",
}
"""Words of commands that stay as they are."""


def _optioned(name: str) -> Door:
    """A command with the values of options.json; names of options and of files are not damaged."""

    def read(path: Path, lib: Library) -> None:
        try:
            given = json_of(path)[name]
            values = {option: str(given[option]) for option in goods.OPTIONS[name]}
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            raise RuntimeFault("no options") from None
        given = (f"{option}={value}" for option, value in values.items())
        _run(path.parent, lib, _WORDS[name], *given)

    return Door("options.json", goods.options, read)


def _study(file: str, seal: Callable[[Path], None] | None = None) -> Door:
    def read(path: Path, _: Library) -> None:
        place = path.parents[1]
        tables = place / OUT / "tables.md"
        write_experiments(place, place / OUT / "report.html", tables_to=tables)

    return Door(f"toy/{file}", goods.study, read, seal)


def _renew_digests(folder: Path) -> None:
    """Write the present digests of the other files into result.json."""
    path = folder / "toy" / "result.json"
    facts = json.loads(path.read_text())
    for name in ("trials.parquet", "series.npz"):
        file = folder / "toy" / name
        if file.is_file() and not file.is_symlink():
            facts["files"][name] = hashlib.sha256(file.read_bytes()).hexdigest()
    path.write_text(json.dumps(facts))


_log, _logs = _alone(read_recording), _folder(read_recording)
_model_seen = _alone(inspect_file)


def _looked(path: Path, lib: Library) -> None:
    look_of(lib, path)


DOORS: dict[str, Door] = {
    # Logs.
    "csv": Door("log.csv", goods.log("log.csv"), _log),
    "csv-gz": Door("log.csv.gz", goods.zipped, _log),
    "npz": Door("log.npz", goods.log("log.npz"), _log),
    "parquet": Door("log.parquet", goods.log("log.parquet"), _log),
    "hdf5": Door("log.h5", goods.hdf5, _log),
    "matlab": Door("log.mat", goods.hdf5, _log),
    "stream-hdf5": Door("log.h5", goods.hdf5, _streamed),
    "lerobot": Door("meta/info.json", goods.lerobot, lambda p, _: read_recording(p.parents[1])),
    "lerobot-frames": Door(
        "data/chunk-000/file-000.parquet",
        goods.lerobot,
        lambda path, _: read_recording(path.parents[2]),
    ),
    "mcap": Door("log.mcap", goods.mcap, _log),
    "cdr": Door("log.cdr.mcap", goods.mcap, _log),
    "ros1": Door("log.bag", goods.ros1, _log),
    "ros2": Door("bag/bag.db3", goods.ros2(), _logs),
    "db3": Door("bag/bag.db3", goods.ros2(), _log),
    "ros2-yaml": Door("bag/metadata.yaml", goods.ros2(), _logs),
    "ros2-packed": Door("bag/bag.db3", goods.ros2("MESSAGE"), _logs),
    "ros2-zstd": Door("bag/bag.db3.zstd", goods.ros2("FILE"), _logs),
    "libfranka": Door("log.csv", goods.franka, _log),
    "folder": Door("recipe.toml", goods.recipe, _logs),
    **{
        f"stream-{kind}": Door(f"log.{kind}", goods.log(f"log.{kind}"), _streamed)
        for kind in ("csv", "npz", "parquet")
    },
    **{
        f"doctor-{kind}": Door(
            f"log.{kind}",
            goods.log(f"log.{kind}", 300),
            _command(f"inspect log.{kind} --recipe-out {{folder}}/out/recipe.toml"),
            offered=("recipe.toml",),
        )
        for kind in ("csv", "npz")
    },
    "headless": Door("log.csv", goods.headless, _command("inspect log.csv")),
    "recipe": Door("recipe.toml", goods.recipe, _alone(load_recipe)),
    # Models.
    "urdf": Door("robot.urdf", goods.urdf, _chain),
    "inspect": Door("robot.urdf", goods.urdf, _model_seen),
    "repair": Door(
        "robot.urdf",
        goods.urdf,
        lambda path, _: repaired(inspect_file(path, with_base=False), path),
    ),
    "mjcf": Door("robot.xml", goods.mjcf, _model_seen, programs=(sys.executable,)),
    "view-urdf": Door("robot.urdf", goods.urdf, _looked),
    **{
        f"{view}{form}": Door(f"mesh.{form}", goods.mesh, _beside(f"{form}.urdf", read))
        for view, read in (("", _model_seen), ("view-", _looked))
        for form in ("stl", "obj", "dae")
    },
    "robot": Door("robot.toml", goods.robot, _alone(read_config)),
    "mechanism": Door("mechanism.toml", goods.mechanism, _mechanism),
    "dh": Door("rows.toml", goods.dh, _model),
    "build-mjcf": Door("robot.xml", goods.mjcf, _model, programs=(sys.executable,)),
    "build-sdf": Door("robot.sdf", goods.sdf, _model),
    "build-xacro": Door("robot.xacro", goods.xacro, _xacro, programs=(sys.executable,)),
    "masses": Door("masses.toml", goods.masses, _masses),
    # Generated folders.
    "manifest": Door("manifest.json", goods.generated, _alone(read_manifest)),
    "library": Door("manifest.json", goods.generated, _folder(load)),
    "request": Door("manifest.json", goods.generated, _folder(request_from_folder)),
    "compile": Door("compile.json", goods.generated, _folder(read_recipe)),
    "build": Door("build.json", goods.generated, _folder(load)),
    # What else is known of a robot.
    "prior": Door("prior.toml", goods.prior, read_prior),
    "fleet": Door("fleet.toml", goods.fleet, read_prior),
    "fleet-unit": Door("units/u0/statistics.npz", goods.units, _fleet),
    "virtual": Door("settings.toml", goods.virtual, lambda path, lib: settings_of(lib, path)),
    "box": Door("box.toml", goods.virtual, lambda path, lib: read_payload(str(path)).pi(lib)),
    "truth": Door("log.truth.json", goods.truth, read_truth),
    "payload": Door("payload.json", goods.payload, _payload),
    # Motions.
    "trajectory": Door("motion.json", goods.trajectory, read_trajectory),
    "loop": Door("loop.toml", goods.trajectory, _controlled),
    "film": Door("motion.json", goods.trajectory, lambda path, lib: read_motion(str(path), lib)),
    "predict": Door(
        "motion.json", goods.trajectory, _command("predict motion.json --noise 0.05 --json")
    ),
    "simulate": Door(
        "motion.json", goods.trajectory, _command(f"{_SIMULATE} --settings keep_every=10")
    ),
    # Results.
    "evaluate": Door("result.json", goods.result, _command("evaluate {folder} log.csv --json")),
    "friction": Door("result.json", goods.result, _renewed),
    "export": Door("result.json", goods.result, _command(f"{_EXPORT}urdf")),
    "export-friction": Door("result.json", goods.result, _command(f"{_EXPORT}friction")),
    "arm": Door("result.json", goods.result, lambda path, lib: read_arm_model(path.parent, lib)),
    "report": Door("result.json", goods.result, _reported),
    "predictions": Door("predictions.npz", goods.result, _reported),
    "compare": Door("compare.json", goods.comparison, _reported),
    # Options of commands.
    **{f"options-{name}": _optioned(name) for name in goods.OPTIONS},
    # Experiments.
    "study": _study("result.json"),
    "study-config": _study("config.json"),
    "trials": _study("trials.parquet", _renew_digests),
    "series": _study("series.npz", _renew_digests),
    "chunk": Door("toy/trials.parquet", goods.study, lambda path, _: read_rows(path, goods.MARK)),
}
