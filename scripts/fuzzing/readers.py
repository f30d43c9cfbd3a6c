"""Functions that read the damaged files of a folder; (folder, robot) → anything."""

import contextlib
import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import typer

from runtime.cli import app_of
from runtime.cli.evaluate import evaluate_command
from runtime.cli.fleet import fleet_command
from runtime.cli.inspect import inspect_command
from runtime.cli.predict import predict_command
from runtime.cli.simulate import simulate_command
from runtime.common.files import json_of
from runtime.errors import RuntimeFault
from runtime.estimators.literature.iv_didim import read_controller
from runtime.experiments.report import write_experiments
from runtime.experiments.storage.chunks import read_rows
from runtime.identification.kept_links import identify_friction
from runtime.identification.saved_result import read_result
from runtime.library import Library
from runtime.outputs.report import write_report
from runtime.recording import read_recording
from scripts.fuzzing import goods

Reader = Callable[[Path, Library], Any]
OUT = "out"
"""Name of the only folder in which a command may write."""


def all_of(*readers: Reader) -> Reader:
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


def urdf(folder: Path, _: Library) -> None:
    """Read a URDF as a chain."""
    from symgen.chain import read_chain
    from symgen.cli.common import read_urdf

    read_chain(read_urdf(folder / "robot.urdf"))


def inspected(file: str) -> Reader:
    """`symgen inspect` of a file."""

    def read(folder: Path, _: Library) -> None:
        from symgen.inspect import inspect_file

        inspect_file(folder / file)

    return read


def repair(folder: Path, _: Library) -> None:
    """Repair a URDF."""
    from symgen.inspect import inspect_file, repaired

    repaired(inspect_file(folder / "robot.urdf", with_base=False), folder / "robot.urdf")


def robot(folder: Path, _: Library) -> None:
    """Read a robot configuration."""
    from symgen.make.config import read_config

    read_config(folder / "robot.toml")


def request(folder: Path, _: Library) -> None:
    """Read the build request of a generated folder."""
    from symgen.make.request import request_from_folder

    request_from_folder(folder)


def evaluated(folder: Path, lib: Library) -> None:
    """Run `evaluate` on a result and a log."""
    evaluate_command(folder, str(folder / "log.csv"), robot=str(lib.folder), as_json=True)


def renewed(folder: Path, lib: Library) -> None:
    """Friction of a log with the links of a result."""
    identify_friction(read_recording(str(folder / "log.csv")), lib, read_result(folder))


def reported(folder: Path, _: Library) -> None:
    """Write a report."""
    write_report(folder, folder / OUT / "report.html")


def experiments(folder: Path, _: Library) -> None:
    """Write the report of experiments."""
    write_experiments(folder, folder / OUT / "report.html", tables_to=folder / OUT / "tables.md")


def renew_digests(folder: Path) -> None:
    """Write the present digests of the other files into result.json."""
    path = folder / "toy" / "result.json"
    facts = json.loads(path.read_text())
    for name in ("trials.parquet", "series.npz"):
        if (folder / "toy" / name).is_file() and not (folder / "toy" / name).is_symlink():
            data = (folder / "toy" / name).read_bytes()
            facts["files"][name] = hashlib.sha256(data).hexdigest()
    path.write_text(json.dumps(facts))


def predicted(folder: Path, lib: Library) -> None:
    """Run `predict` on a motion."""
    predict_command(str(folder / "motion.json"), robot=str(lib.folder), noise="0.05", as_json=True)


def simulated(folder: Path, lib: Library) -> None:
    """Run `simulate` along a motion."""

    class Typed:
        """Context of a command line with the robot and the motion only."""

        command = SimpleNamespace(params=())

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


def looped(folder: Path, lib: Library) -> None:
    """Simulate a controller file for a second."""
    loop = read_controller(folder / "loop.toml", lib)
    loop.simulate(lib, lib.pi0, {}, np.linspace(loop.start, loop.start + 1.0, 50))


def headless(folder: Path, lib: Library) -> None:
    """Run `inspect` on a log without header."""
    with contextlib.suppress(typer.Exit):
        inspect_command(str(folder / "log.csv"), robot=str(lib.folder))


def masses(folder: Path, _: Library) -> None:
    """Read masses and a URDF without <inertial>."""
    from symgen.chain import ChainOptions, read_chain
    from symgen.cli.common import read_urdf
    from symgen.make.config import read_masses

    options = ChainOptions(masses=read_masses(folder / "masses.toml"))
    read_chain(read_urdf(folder / "robot.urdf"), options)


def mechanism(folder: Path, _: Library) -> None:
    """Read a mechanism and the URDF that it completes."""
    from symgen.chain import ChainOptions, read_chain
    from symgen.cli.common import read_mechanism, read_urdf

    read = read_mechanism(folder / "mechanism.toml")
    read_chain(read_urdf(folder / "robot.urdf"), ChainOptions(mechanism=read))


def built(file: str) -> Reader:
    """Read what `symgen build --urdf FILE` reads, as a chain."""

    def read(folder: Path, _: Library) -> None:
        from symgen.chain import ChainOptions, read_chain
        from symgen.chain.mechanism import Mechanism
        from symgen.make.sources import Source, read_source

        text, mechanism = read_source(Source(folder / file), Mechanism())
        read_chain(text, ChainOptions(mechanism=mechanism))

    return read


def xacro(folder: Path, _: Library) -> None:
    """Expand and read a xacro file, in a process of little time."""
    from symgen.chain import read_chain
    from symgen.ros import Limits, Packages, expanded

    limits = Limits(seconds=1, patience=60.0, memory=2**28)
    read_chain(expanded(folder / "robot.xacro", {}, Packages(), limits))


def fleet(folder: Path, lib: Library) -> None:
    """Compute the prior of a fleet."""
    (folder / OUT).mkdir(exist_ok=True)
    out = folder / OUT / "fleet.toml"
    try:
        fleet_command(folder / "units", out=out, robot=str(lib.folder), overwrite=True)
    finally:  # parts of a run that ended early are kept on purpose
        shutil.rmtree(folder / OUT / "fleet.toml.parts", ignore_errors=True)


def rows(folder: Path, _: Library) -> None:
    """Read rows of trials."""
    read_rows(folder / "toy" / "trials.parquet", goods.MARK)


_FILES: dict[str, tuple[str, ...]] = {
    "identify": ("log.csv", "--out", "{folder}/out/result"),
    "excite": ("--document", "--out", "{folder}/out/motion.json"),
    "simulate": ("--trajectory", "motion.json", "--ideal", "--out", "{folder}/out/log.csv"),
    "predict": ("motion.json",),
}
"""Words of commands that stay as they are."""


def with_options(name: str) -> Reader:
    """A command with the values of options.json; names of options and of files are not damaged."""

    def read(folder: Path, lib: Library) -> None:
        try:
            given = json_of(folder / "options.json")[name]
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

    return read
