"""`python -m runtime`: models and motions exported for others."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import Safety
from runtime.excitation.proof.certificate import DISTANCES, Certificate, certificate_of
from runtime.excitation.search.design import Design, design
from runtime.library import Library
from runtime.outputs.model_files.export_format import EXPORT_FORMATS
from tests.plugins import add_toy
from tests.runtime.conftest import Command


def test_export_writes_what_others_load(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: every format of a result, checked; nothing is replaced without --overwrite."""
    words = ("--friction", "viscous,coulomb", "--method", "pc-ols", "--out", "out")
    assert command("identify", log, "--robot", lib.folder, *words).code == 0
    ran = command("export", "out", "--robot", lib.folder)
    assert ran.code == 0, ran.err
    written = {path.name for path in (tmp_path / "out" / "export").iterdir()}
    assert written == {
        *("fr3.urdf", "fr3.xml", "fr3.sdf", "fr3.usda", "inertials.yaml", "dynamics.yaml"),
        *("fr3_identified.h", "fr3_gravity.h", "fr3_identified_dynamics"),
    }
    assert ran.out.count("verified: reloaded by") == 9
    again = command("export", "out", "--robot", lib.folder, "--to", "mjcf,urdf")
    assert again.code == 2
    assert "fr3.xml' and 1 more files exist" in again.err
    assert command("export", "out", "--robot", lib.folder, "--to", "urdf", "--overwrite").code == 0
    assert "friction, header, casadi; got 'vrml'" in command("export", "out", "--to", "vrml").err
    assert "no valid result.json" in command("export", tmp_path).err


TOY = """
import csv
import io

from runtime.outputs.model_files.export_format import ExportFormat


def masses(model):
    text = io.StringIO()
    rows = ((name, repr(body.mass)) for name, body in model.bodies.by_link.items())
    csv.writer(text).writerows([("link", "mass"), *rows])
    return text.getvalue()


def check(model, text):
    read = [float(row["mass"]) for row in csv.DictReader(io.StringIO(text))]
    assert read == [body.mass for body in model.bodies.by_link.values()]
    return "verified: read again by csv"


TOY = ExportFormat("toy", "CSV of masses", "{robot}_masses.csv", masses, check)
"""


def test_a_format_of_another_package_is_used_by_its_name(
    command: Command, lib: Library, log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: an entry point adds a format to --formats, --to and the messages."""
    words = ("--robot", lib.folder, "--method", "pc-ols", "--out", "out")
    assert command("identify", log, *words).code == 0
    (tmp_path / "site").mkdir()
    add_toy(tmp_path / "site", EXPORT_FORMATS, "toy", TOY, "TOY", monkeypatch)
    assert command("export", "--formats").out.splitlines()[-1] == "toy: CSV of masses"
    ran = command("export", "out", "--robot", lib.folder, "--to", "toy")
    assert ran.code == 0, ran.err
    assert "(verified: read again by csv)" in ran.out
    lines = (tmp_path / "out" / "export" / "fr3_masses.csv").read_text().splitlines()
    assert lines[0] == "link,mass"
    assert {line.split(",")[0] for line in lines[1:]} >= set(lib.link_names)
    assert "header, casadi, toy; got 'vrml'" in command("export", "out", "--to", "vrml").err


def test_export_says_what_it_could_not_write(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: bodies that cannot exist are refused one by one, exit code 2, nothing left."""
    words = ("--method", "ols", "--friction", "none", "--out", "out")
    run = command("identify", log, "--robot", lib.folder, *words)
    assert run.code == 0
    ran = command("export", "out", "--robot", lib.folder, "--to", "urdf,header")
    assert ran.code == 2
    assert "2 of 2 not written: urdf, header" in ran.err
    assert "urdf: not written: expected physically consistent links, got fr3_link" in ran.out
    assert not (tmp_path / "out" / "export").exists()


def test_inconsistent_models_get_no_urdf(
    command: Command, lib: Library, log: Path, tmp_path: Path
) -> None:
    """Property: least squares on noise gives no bodies, so there is nothing to simulate."""
    out = tmp_path / "out"
    ran = command("identify", log, "--robot", lib.folder, "--method", "ols", "--out", out)
    assert ran.code == 0
    assert json.loads((out / "result.json").read_text())["consistent"] is False
    assert not (out / "identified.urdf").exists()
    assert "not written" in ran.out


def test_excite_exports_what_it_can_prove(command: Command, lib: Library, tmp_path: Path) -> None:
    """Property: files per kind and stage, a table per stage; a CSV only if requested."""
    words = (
        "--duration",
        "4",
        "--settings",
        "harmonics=2",
        "--settings",
        "starts=1",
        "--settings",
        "export_rate=100",
    )
    stages = ("--speed", "10", "--speed", "100", "--export", "ros", "--export", "libfranka")
    stages = (*stages, "--table", "none")
    ran = command("excite", "--robot", lib.folder, *words, *stages, "--out", "m.json")
    assert ran.code == 0, ran.err
    assert "certificate at 10 % speed: holds at every instant" in ran.out
    assert "certificate at 100 % speed: holds at every instant" in ran.out
    kinds = ("certificate.json", "libfranka.csv", "ros.yaml")
    expected = {f"{stem}.{kind}" for stem in ("m", "m-speed10") for kind in kinds}
    assert {path.name for path in tmp_path.iterdir()} == {"m.json", "m.settings.toml", *expected}
    uses = json.loads((tmp_path / "m.certificate.json").read_text())["uses"]
    shares = [use["bound"] for use in uses if use["limit"] not in DISTANCES]
    # An exported motion leaves 5 % of every limit; 1e-8 is rounding.
    assert 0.94 < max(shares) <= 0.95 + 1e-8
    slow = (tmp_path / "m-speed10.libfranka.csv").read_text()
    assert len(re.findall("^[0-9]", slow, re.MULTILINE)) == 40_001


UNCHECKED = ("--settings", "unchecked=self-collision")
"""The arm of two joints, on which a motion is cheap, has no collision proxies."""


def test_excite_exports_nothing_that_breaks_a_limit(
    command: Command, double: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: one sentence, exit code 2; the design stays, no file for a robot is written."""
    from runtime.cli import excite

    def wild(*words: object, **options: object) -> Design:
        optimum = design(*words, **options)  # type: ignore[arg-type]
        inside = 0.9 * optimum.trajectory.coefficients  # positions hold, too fast is what it is
        faster = replace(optimum.trajectory, coefficients=inside, duration=2.5)
        return replace(optimum, trajectory=faster)

    monkeypatch.setattr(excite, "design", wild)
    words = (
        "--duration",
        "4",
        "--settings",
        "harmonics=2",
        "--settings",
        "starts=1",
        "--out",
        "m.json",
    )
    # The slow stage would hold, the fast one does not: neither is written.
    stages = ("--speed", "10", "--speed", "100")
    ran = command(
        *("excite", "--robot", double.folder, *words, *stages, "--table", "none"),
        *("--export", "ros", *UNCHECKED),
    )
    assert ran.code == 2
    assert "does NOT hold" in ran.out
    assert ran.err.startswith("runtime: nothing is exported, the motion exceeds limits: ")
    assert re.search(r"add --speed \d\d, at which they are kept$", ran.err.strip())
    assert len(ran.err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["m.json"]
    ran = command("excite", "--robot", double.folder, "--speed", "150", "--out", "n.json")
    assert (ran.code, (tmp_path / "n.json").exists()) == (2, False)
    assert "up to 100 %, got 150 %" in ran.err


def test_excite_leaves_a_measured_log_alone(
    command: Command, double: Library, tmp_path: Path
) -> None:
    """Property: refused before the search; replaced with --settings overwrite=true."""
    words = ("excite", "--robot", double.folder, "--duration", "4", "--settings", "harmonics=2")
    words = (*words, "--settings", "starts=1", "--settings", "document=true", "--out", "m.json")
    log = tmp_path / "m.motion.csv"
    log.write_text("t,q1,tau1\n0,0,0\n", encoding="utf-8")
    ran = command(*words)
    assert ran.code == 2
    assert ran.err.startswith("runtime: 'm.motion.csv' exists; choose another place with --out")
    assert len(ran.err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["m.motion.csv"]
    assert log.read_text(encoding="utf-8") == "t,q1,tau1\n0,0,0\n"
    assert command(*words, "--settings", "overwrite=true").code == 0
    assert len(log.read_text(encoding="utf-8").splitlines()) > 100


def test_excite_certifies_a_motion_once(
    command: Command, double: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Property: table, pictures and exports share one certificate; other speeds have theirs."""
    from runtime.excitation.proof import certificate

    durations, pictures = [], ("m.png", "m-speed.png", "m-space.png")

    def counted(lib: Library, trajectory: Trajectory, safety: Safety | None = None) -> Certificate:
        durations.append(trajectory.duration)
        return certificate_of(lib, trajectory, safety)

    monkeypatch.setattr(certificate, "certificate_of", counted)
    words = (
        "--duration",
        "4",
        "--settings",
        "harmonics=2",
        "--settings",
        "starts=1",
        "--settings",
        "pictures=true",
    )
    exports = (
        "--table",
        "none",
        "--export",
        "ros",
        "--export",
        "csv",
        "--settings",
        "export_rate=100",
    )
    words = ("excite", "--out", "m.json", "--robot", double.folder, *words, *exports, *UNCHECKED)
    ran = command(*words)
    assert ran.code == 0, ran.err
    assert durations == [4.0]
    assert f"trajectory: m.json, {', '.join(pictures)}" in ran.out
    assert {path.name for path in tmp_path.glob("*.png")} == set(pictures)
    durations.clear()
    ran = command(*words, "--speed", "50", "--speed", "100", "--settings", "overwrite=true")
    assert ran.code == 0, ran.err
    assert durations == [4.0, 8.0]
