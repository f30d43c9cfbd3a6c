"""The console command `symgen`: what it imports, what it prints, and which package it runs."""

import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from importlib import import_module
from inspect import getdoc
from pathlib import Path
from types import ModuleType

import pytest

import runtime.cli
import symgen.cli
from runtime.common.commands import GROUPS, Command
from symgen import __version__
from symgen.cli.console import INSPECT_FLAGS, inspected_file, is_model, main
from tests.conftest import REPOSITORY, TINY_URDF

SCRIPT = "import sys\nfrom symgen.cli.console import main\nsys.exit(main())\n"
COMMANDS = [command for group in GROUPS.values() for command in group]
APPS: dict[str, ModuleType] = {"symgen": symgen.cli, "runtime": runtime.cli}
EXAMPLE = REPOSITORY / "runtime" / "examples" / "fr3_simulated.npz"


@pytest.fixture(scope="module")
def script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file `symgen` that pip writes for the entry point."""
    path = tmp_path_factory.mktemp("bin") / "symgen"
    path.write_text(SCRIPT)
    return path


def run(
    script: Path, *words: object, cwd: Path | None = None, columns: int = 100
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(script), *map(str, words)],
        cwd=cwd or script.parent,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "COLUMNS": str(columns)},
        capture_output=True,
        text=True,
        check=False,
    )


def imported(*lines: list[str]) -> set[str]:
    """Top-level modules outside the standard library that command lines import."""
    code = (
        "import sys\nbefore = set(sys.modules)\nfrom symgen.cli.console import main\n"
        f"for words in {lines!r}:\n    sys.argv = ['symgen', *words]\n"
        "    try:\n        main()\n    except SystemExit:\n        pass\n"
        "tops = {name.partition('.')[0] for name in set(sys.modules) - before}\n"
        "print('MODULES', *sorted(tops - set(sys.stdlib_module_names)), sep='\\n')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    return set(done.stdout.split("MODULES\n")[1].split())


def first_sentence(doc: str) -> str:
    paragraph = " ".join(doc.partition("\n\n")[0].split())
    return re.split(r"(?<=[.?])\s", paragraph)[0]


def options_of(package: str, name: str) -> tuple[set[str], set[str]]:
    """Names of the flags and of the options with a value of a command."""
    import typer

    group = typer.main.get_command(APPS[package].app)
    flags: set[str] = set()
    valued: set[str] = set()
    for parameter in group.commands[name].params:  # type: ignore[attr-defined]
        if parameter.param_type_name == "option":
            names = {*parameter.opts, *parameter.secondary_opts}
            (flags if parameter.is_flag else valued).update(names)
    return flags, valued


def test_both_packages_state_the_version() -> None:
    """Property: one distribution, one version, whichever package is imported."""
    assert runtime.__version__ == __version__


def test_entry_point() -> None:
    """Property: pip makes the command from this function."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["scripts"] == {"symgen": "symgen.cli.console:main"}


def test_overview_imports_no_command() -> None:
    """Property: neither numpy nor casadi nor a command is imported for any form of the overview."""
    used = imported([], ["--help"], ["-h"], ["--version"], ["identfy"])
    assert {"symgen", "typer"} <= used
    assert not used & {"numpy", "scipy", "casadi", "pinocchio", "mujoco", "matplotlib", "jinja2"}


def test_help_of_a_command_imports_its_side_only() -> None:
    """Property: the run-time side needs no library of the build, neither a simulator or figures."""
    used = imported(["locate", "--help"])
    assert {"typer", "runtime"} <= used
    assert not used & {"casadi", "pinocchio", "mujoco", "matplotlib", "jinja2"}
    assert not imported(["build", "--help"]) & {"mujoco", "matplotlib"}


def test_help_of_inspect_without_the_libraries_of_the_build() -> None:
    """Property: the page of logs is printed, and what the page of models needs."""
    code = (
        "import sys; sys.modules['pinocchio'] = None; sys.argv = ['symgen', 'inspect', '--help']; "
    )
    words = [sys.executable, "-c", f"{code}from symgen.cli.console import main; main()"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, cwd=REPOSITORY)
    assert done.returncode == 0
    assert done.stdout.count("Usage: symgen inspect ") == 1
    assert "inspect MODEL needs the package pinocchio; run: pip install" in done.stdout


@pytest.mark.parametrize("command", COMMANDS, ids=lambda c: f"{c.package}-{c.name}")
def test_sentences_are_those_of_the_commands(command: Command) -> None:
    """Property: the overview says what `symgen COMMAND --help` says first."""
    function = getattr(import_module(command.module), f"{command.name}_command")
    assert first_sentence(getdoc(function) or "") == command.sentence


def test_every_command_is_listed() -> None:
    """Property: every function NAME_command of both packages is in the overview, each once."""
    listed = [(command.module, command.name) for command in COMMANDS]
    assert len(set(listed)) == len(listed)
    written = {
        (".".join(path.relative_to(REPOSITORY).with_suffix("").parts), name)
        for package in APPS
        for pattern in ("cli/*.py", "*/command.py")
        for path in (REPOSITORY / package).glob(pattern)
        for name in re.findall(r"^def (\w+)_command\(", path.read_text(), re.MULTILINE)
    }
    assert set(listed) == written


def test_flags_of_inspect() -> None:
    """Property: the file among the arguments is found although options precede it."""
    for package in APPS:
        flags, valued = options_of(package, "inspect")
        assert flags - {"--help", "-h"} <= INSPECT_FLAGS
        assert not valued & INSPECT_FLAGS
    assert inspected_file(["--json", "--recipe", "r.toml", "log.csv"]) == "log.csv"
    assert inspected_file(["--repair=b.urdf", "a.urdf", "--strict"]) == "a.urdf"
    assert inspected_file(["--", "-odd.csv"]) == "-odd.csv"
    assert inspected_file(["--help"]) is None


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.urdf", TINY_URDF.encode(), True),
        ("a.txt", TINY_URDF.encode(), True),  # the content decides, not the name
        ("bom.xml", b"\xef\xbb\xbf" + TINY_URDF.encode(), True),
        ("wide.xml", TINY_URDF.encode("utf-16"), True),
        ("late.xml", b"\n\n  <?xml version='1.0'?><!-- a comment --><mujoco/>", True),
        ("log.csv", b"t,q1\n0,1\n", False),
        ("log.xml", b"t,q1\n0,1\n", False),
        ("empty.urdf", b"", True),
        ("empty.csv", b"", False),
        ("missing.xacro", None, True),
        ("panda_gaz", None, False),
    ],
)
def test_inspect_decides_by_content(
    name: str, content: bytes | None, expected: bool, tmp_path: Path
) -> None:
    """Property: XML is a model; a log, a folder and the name of a data set are not."""
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert is_model(tmp_path / name) is expected
    (tmp_path / "folder.urdf").mkdir(exist_ok=True)
    assert not is_model(tmp_path / "folder.urdf")


def test_overview_fits_the_terminal(script: Path) -> None:
    """Property: no line is wider than 80 columns, and every command stands at the line's start."""
    lines = run(script, "--help", columns=80).stdout.splitlines()
    assert max(map(len, lines)) <= 80
    for command in COMMANDS:
        title = f"{command.name} {command.argument}".strip()
        assert any(line.startswith(f"│ {title} ") for line in lines), title
    text = " ".join(" ".join(line.strip("│ ") for line in lines).split())
    for head, group in GROUPS.items():
        assert f"─ {head} ─" in text
        assert all(command.sentence in text for command in group)


def test_program_in_a_process(script: Path) -> None:
    """Property: the version, and a command of the other package."""
    assert run(script, "--version").stdout == f"symgen {__version__}\n"
    for module in ("runtime", "symgen"):
        words = [sys.executable, "-m", module, "--version"]
        ran = subprocess.run(words, capture_output=True, text=True, check=False, cwd=REPOSITORY)
        assert (ran.returncode, ran.stdout.split()[-1]) == (0, __version__)
    words = [sys.executable, "-m", "symgen", "report", "-h"]
    ran = subprocess.run(words, capture_output=True, text=True, check=False, cwd=REPOSITORY)
    assert "Usage: python -m symgen report " in ran.stdout


Here = Callable[..., tuple[object, str, str]]
"""Words → exit code, output and errors of the program in this process."""


@pytest.fixture
def here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Here:
    """The program as `symgen` starts it, in this process, which has imported what it needs."""

    def call(*words: object) -> tuple[object, str, str]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setenv("COLUMNS", "100")
        monkeypatch.setattr(sys.modules["__main__"], "__package__", "")  # python -m pytest
        monkeypatch.setattr(sys, "argv", [str(tmp_path / "symgen"), *map(str, words)])
        capsys.readouterr()
        code: object = 0
        try:
            code = main()
        except SystemExit as end:
            code = end.code
        return code or 0, *capsys.readouterr()

    return call


def test_usage_unknown_commands_and_both_kinds_of_inspect(here: Here, tmp_path: Path) -> None:
    """Property: exit codes and what is printed."""
    assert here("identfy", "log.csv") == (
        2,
        "",
        "symgen: expected a command such as 'identify', got 'identfy'; run: symgen --help\n",
    )
    for name in ("build", "identify"):
        code, out, err = here(name, "-h")
        assert code == 0, err
        assert f"Usage: symgen {name} " in out
    code, out, err = here("inspect", "--help")
    assert code == 0, err
    assert out.count("Usage: symgen inspect ") == 2
    model = tmp_path / "model.txt"
    model.write_text(TINY_URDF)
    _, out, err = here("inspect", model, "--json")
    assert json.loads(out)["format"] == "URDF", err
    code, _, err = here("inspect", "nowhere.csv")
    assert code == 2
    assert err.startswith("symgen: ")
    assert "nowhere.csv" in err


def test_working_directory_is_not_imported_from(script: Path, tmp_path: Path) -> None:
    """Property: a file of the user called numpy.py is not run by the command."""
    for name in ("numpy", "typer", "runtime", "symgen"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('imported from here')\n")
    ran = run(script, "locate", "nothing", cwd=tmp_path)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith("symgen: there is no data set or robot 'nothing'")


def test_provenance_names_the_program(here: Here) -> None:
    """Property: result files hold the command line as it was typed."""
    code, out, err = here("inspect", EXAMPLE, "--json")
    assert code in {0, 1}, err
    assert json.loads(out)["command"] == f"symgen inspect {EXAMPLE} --json"


COMPLETED = {
    "pr": {"predict", "proxies"},
    "insp": {"inspect"},
    "identify --fri": {"--friction"},
    "identify --friction v": {"viscous"},
    "identify --method m": {"map"},
    "predict --robot u": {"ur5e"},
    "build --robot f": {"fr3"},
    "inspect arm.urdf --rep": {"--repair"},
    "inspect log.csv --rec": {"--recipe"},
    "identify log": set(),
}
"""Words → what a shell offers, among others; nothing where files are left to the shell."""
BY_BASH = ("pr", "identify --fri", "identify log")
"""Words for which bash starts the program; for the others this process answers what bash asks."""
COMPLETE = """COMP_WORDS=(symgen {})
COMP_CWORD={}
_symgen_completion symgen
printf '%s ' "${{COMPREPLY[@]}}"
echo
"""


@pytest.fixture(scope="module")
def completed(script: Path) -> dict[str, set[str]]:
    """What bash offers after words, by the script that `--show-completion` prints."""
    program = script.parent / "bin" / "symgen"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{script}" "$@"\n')
    program.chmod(0o755)
    calls = (COMPLETE.format(words, len(words.split())) for words in BY_BASH)
    path = os.pathsep.join([str(program.parent), os.environ["PATH"]])
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY), "PATH": path}
    words = ["/bin/bash", "-c", "\n".join(['eval "$(symgen --show-completion)"', *calls])]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    return dict(zip(BY_BASH, (set(line.split()) for line in lines), strict=True))


@pytest.mark.parametrize("words", BY_BASH)
def test_a_shell_completes(completed: dict[str, set[str]], words: str) -> None:
    """Oracle: bash itself, with the printed script; files are left to the shell."""
    assert completed[words] >= COMPLETED[words]
    assert COMPLETED[words] or not completed[words]


@pytest.mark.parametrize("words", [words for words in COMPLETED if words not in BY_BASH])
def test_words_are_completed(here: Here, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Property: the program offers what follows, asked as by the script of bash."""
    monkeypatch.setenv("_SYMGEN_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", f"symgen {words}")
    monkeypatch.setenv("COMP_CWORD", str(len(words.split())))
    code, out, err = here()
    assert (code, err) == (0, "")
    assert {*out.split()} >= COMPLETED[words]


@pytest.mark.parametrize("words", [("--version",), ("--help",)])
def test_a_reader_that_ends_first_sees_no_traceback(script: Path, words: tuple[str, ...]) -> None:
    """Property: as behind `| head`: the pipe is closed before the output is written."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = subprocess.run(
            [sys.executable, script, *words],
            stdout=writing,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        )
    finally:
        os.close(writing)
    assert done.stderr == ""
    assert done.returncode == 1
