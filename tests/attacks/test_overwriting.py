"""Files of the user are replaced with --overwrite only, by every command of both programs."""

import json
import sys
from pathlib import Path

import pytest
import typer

import runtime.cli
import symgen.cli
from symgen.errors import BuildError
from symgen.make.pipeline import require_no_foreign_file
from tests.conftest import TINY_URDF
from tests.runtime.conftest import Command
from tests.runtime.desk import Desk, digests

WRITING = {"out", "recipe_out", "plot", "html", "markdown", "figures", "repair"}
"""Parameters of commands that name a file or a folder to write."""
EXEMPT = {
    ("runtime", "campaign"): "continues the campaign of its folder and refuses other folders",
    ("runtime", "reproduce"): "continues the trials of its folder and refuses other ones",
    ("symgen", "check"): "--out is the folder that it reads",
    ("symgen", "clean"): "deletes",
    ("symgen", "describe"): "--out is the folder that it reads",
    ("symgen", "list"): "--out is the folder that it reads",
}
LOG_FILES = ("s.csv", "s.truth.json", "s.motion.json", "s.loop.toml", "s.settings.toml")
MOTION_FILES = ("e.json", "e.motion.csv", "e.settings.toml")
STAGES = tuple(
    f"e{speed}{end}"
    for speed in ("", "-speed50")
    for end in (".libfranka.csv", ".ros.yaml", ".certificate.json")
)
RESULT_FILES = tuple(
    f"out/{name}"
    for name in (
        *("result.json", "predictions.npz", "posterior.npz"),
        *("identified.urdf", "report.html", "settings.toml"),
    )
)
CASES: dict[str, tuple[tuple[object, ...], tuple[str, ...]]] = {
    "simulate": (("simulate", "--trajectory", "good.json", "--out", "s.csv"), LOG_FILES),
    "excite": (("excite", "--out", "e.json"), MOTION_FILES),
    "excite --export": (
        (
            *("excite", "--out", "e.json", "--export", "ros", "--export", "libfranka"),
            *("--speed", "100", "--speed", "50", "--table", "none", "--settings", "unchecked=all"),
        ),
        ("e.json", "e.settings.toml", *STAGES),
    ),
    "approach": (("approach", "good.json", "--from", "home", "--out", "e.json"), MOTION_FILES),
    "excite --settings pictures=true": (
        ("excite", "--out", "e.json", "--settings", "pictures=true"),
        ("e.json", "e.settings.toml", "e.motion.csv", "e.png", "e-speed.png", "e-space.png"),
    ),
    "identify": (("identify", "good.csv", "--out", "out"), RESULT_FILES),
    "friction": (("friction", "result", "good.csv", "--out", "out"), RESULT_FILES),
    "compare": (
        ("compare", "good.csv", "--methods", "ols", "--out", "out"),
        ("out/compare.json", "out/compare.md", "out/report.html", "out/settings.toml"),
    ),
    "payload": (
        ("payload", "good.csv", "--out", "out"),
        tuple(
            f"out/{name}"
            for name in (
                *("payload.json", "set_load.json", "endeffector-config.json", "payload.urdf"),
                *("set_target_payload.script", "load_data.krl"),
                *("kinova_payload.json", "xarm_tcp_load.json", "settings.toml"),
            )
        ),
    ),
    "observe": (
        ("observe", "good.csv", "--model", "result", "--out", "out"),
        (
            *("out/contacts.json", "out/external_torque.npz", "out/external_torque.png"),
            *("out/observer.h", "out/observer.c", "out/example_observer.c"),
            "out/settings.toml",
        ),
    ),
    "sample": (
        ("sample", "result", "--count", 2, "--out", "out"),
        (
            "out/samples.json",
            "out/samples.npz",
            "out/model_0001.xml",
            "out/model_0002.xml",
            "out/settings.toml",
        ),
    ),
    "inspect": (("inspect", "good.csv", "--plot", "p.png"), ("p.png",)),
    "predict": (("predict", "good.csv", "--settings", "plot=p.png"), ("p.png",)),
    "view": (("view", "good.json", "--html", "v.html"), ("v.html",)),
    "inspect --recipe-out": (("inspect", "good.csv", "--recipe-out", "r.toml"), ("r.toml",)),
    "gains": (
        ("gains", "good.csv", "bad.csv", "--payload", "3,0,0,0.05", "--recipe-out", "r.toml"),
        ("r.toml",),
    ),
}


def programs() -> list[tuple[str, str, set[str]]]:
    """Program, command and parameters of all commands."""
    apps = {"runtime": runtime.cli.app, "symgen": symgen.cli.app}
    return [
        (program, name, {str(p.name) for p in (*command.params, *command.settings)})
        for program, app in apps.items()
        for name, command in typer.main.get_command(app).commands.items()  # type: ignore[attr-defined]
    ]


@pytest.mark.parametrize(
    ("program", "name", "options"),
    [pytest.param(*case, id=" ".join(case[:2])) for case in programs()],
)
def test_every_command_that_writes_has_the_option(
    program: str, name: str, options: set[str]
) -> None:
    """Property: one rule for all commands; exceptions are the ones listed here."""
    if options & WRITING and (program, name) not in EXEMPT:
        assert "overwrite" in options


@pytest.mark.parametrize("case", CASES)
def test_nothing_is_replaced(case: str, desk: Desk, command: Command) -> None:
    """Property: each single file that is in the way stops the command, and nothing is written."""
    words, files = CASES[case]
    assert desk.log.tau is not None
    desk.changed(tau=1.1 * desk.log.tau)  # bad.csv
    for name in files:
        path = desk.folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("mine")
        before = digests(desk.folder)
        ran = command(*words, "--robot", desk.lib.folder)
        assert ran.code == 2, (name, ran.out)
        assert f"'{name}' exists" in ran.err
        assert "overwrite" in ran.err
        assert len(ran.err.splitlines()) == 1
        assert digests(desk.folder) == before
        path.unlink()


@pytest.mark.parametrize("case", ["simulate", "identify", "payload", "inspect", "excite"])
def test_all_files_are_looked_for(case: str, desk: Desk, command: Command) -> None:
    """Property: the files that are looked for are those that are written, with --settings
    overwrite=true too.
    """
    words, files = CASES[case]
    if case == "excite":
        words = (
            *words,
            "--settings",
            "document=true",
            "--duration",
            "4",
            "--settings",
            "harmonics=2",
            "--settings",
            "starts=1",
        )
    before = set(digests(desk.folder))
    (desk.folder / files[0]).parent.mkdir(exist_ok=True)
    for name in files[1:]:
        (desk.folder / name).write_text("mine")
    ran = command(*words, "--robot", desk.lib.folder, "--settings", "overwrite=true")
    assert ran.code in {0, 1}, ran.err
    assert set(digests(desk.folder)) - before == {str(desk.folder / name) for name in files}
    assert not any((desk.folder / name).read_bytes() == b"mine" for name in files)


@pytest.mark.parametrize("case", ["identify", "compare", "payload"])
def test_a_result_of_the_same_command_is_replaced_and_it_is_printed(
    case: str, desk: Desk, command: Command
) -> None:
    """Property: the folder of a result takes a later one; that of another command does not."""
    words, files = CASES[case]
    words = (*words, "--robot", desk.lib.folder)
    assert command(*words).code == 0
    again = command(*words)
    assert again.code == 0
    assert f"the earlier result of {case} in 'out' will be replaced" in again.err
    (desk.folder / files[0]).write_text(json.dumps({"robot": "fr3"}))
    assert command(*words).code == 2


def test_the_page_of_a_folder(desk: Desk, command: Command) -> None:
    """Property: `report` replaces its own page and says so; other pages stay."""
    assert command(*desk.identify("good.csv")).code == 0
    again = command("report", "out")
    assert again.code == 0
    assert "the earlier page 'out/report.html' will be replaced" in again.err
    page = desk.folder / "out" / "report.html"
    page.write_text("<p>mine</p>")
    for words in (("report", "out"), ("report", "out", "--out", "out/report.html")):
        assert command(*words).code == 2
        assert page.read_text() == "<p>mine</p>"
        assert command(*words, "--overwrite").code == 0
        page.write_text("<p>mine</p>")


def test_a_build_replaces_files_of_builds_only(tmp_path: Path) -> None:
    """Property: a README.md in a folder of the robot's name is not the tool's to replace."""
    new, old = tmp_path / "new", tmp_path / "old"
    for folder in (new, old):
        folder.mkdir()
        (folder / "README.md").write_text(folder.name)
    with pytest.raises(BuildError, match=r"README\.md' exists, .* give --overwrite"):
        require_no_foreign_file(new, old)
    (old / "README.md").write_text("new")  # the same content
    require_no_foreign_file(new, old)
    (old / "README.md").write_text("old")
    (old / "manifest.json").write_text("{}")  # an earlier build
    require_no_foreign_file(new, old)
    require_no_foreign_file(new, tmp_path / "missing")


def test_proxies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Property: refused before any work, and the file stays."""
    (tmp_path / "tiny.urdf").write_text(TINY_URDF)
    (tmp_path / "p.toml").write_text("mine")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["symgen", "proxies", "tiny.urdf", "--out", "p.toml"])
    with pytest.raises(SystemExit) as end:
        symgen.cli.main()
    assert end.value.code == 2
    assert "'p.toml' exists; choose another file, or give --overwrite" in capsys.readouterr().err
    assert (tmp_path / "p.toml").read_text() == "mine"
