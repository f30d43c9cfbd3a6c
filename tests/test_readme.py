"""README and docs do what they say: every block runs, every table is what its script prints."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from runtime.cli.identify import IdentifySettings
from runtime.common.settings import stated_settings
from runtime.estimators.literature.iv_didim import read_controller
from runtime.estimators.prior_file import read_prior
from runtime.excitation import Trajectory
from runtime.excitation.limits.safety import read_obstacles
from runtime.excitation.motion.trajectory import write_motion
from runtime.recording.recipes.recipe_file import load_recipe
from symgen.chain.mechanism import Mechanism
from symgen.cli.make import read_mechanism
from symgen.make.config import read_config
from symgen.sources import Source, read_source
from tests.free_base_logs import Experiment, virtual_log
from tests.markdown import blocks, run_all
from tests.robots import DATA

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs").rglob("*.md"))]
EXECUTED = [
    page
    for page in PAGES
    if {"bash", "python"} & {language for language, _ in blocks(page.read_text(encoding="utf-8"))}
]
LONGEST = 150


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def shown(language: str) -> list[str]:
    """Every block of one language, of all pages."""
    texts = (page.read_text(encoding="utf-8") for page in PAGES)
    return [block for text in texts for kind, block in blocks(text) if kind == language]


def run(command: list[str], cwd: Path) -> str:
    done = subprocess.run(
        command,
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def empty(tmp_path_factory, fr3):
    """A new folder, in which the blocks of the README are pasted; the FR3 is built."""
    return tmp_path_factory.mktemp("readme")


@pytest.fixture(scope="module")
def desk(empty, fr3):
    """A user's folder: a URDF of two joints, a motion, and the FR3 as `symgen build` makes it."""
    (empty / "generated").mkdir()
    (empty / "generated" / "fr3").symlink_to(fr3.folder)
    tutorial = (ROOT / "runtime/tutorials/own-robot.md").read_text(encoding="utf-8")
    (arm,) = (block for language, block in blocks(tutorial) if language == "xml")
    (empty / "my.urdf").write_text(arm, encoding="utf-8")
    shutil.copy(ROOT / "runtime/examples/fr3_trajectory.json", empty / "motion.json")
    return empty


def test_every_fence_is_of_a_kind_that_is_tested():
    """Property: no block of README and docs escapes the tests below."""
    for page in PAGES:
        kinds = re.findall(r"^```(\w*)\n", page.read_text(encoding="utf-8"), re.MULTILINE)
        known = {"bash", "console", "toml", "python", "c", "cpp", "text"}
        assert set(kinds) - {""} <= known, name_of(page)


FOREIGN = {
    "my.urdf": "`my.urdf` is any URDF, such as that of [Your own robot]",
    "motion.json": "`motion.json` comes from `symgen excite",
    "results/first": "`results/first` comes from `symgen identify",
}
"""Files that blocks find in the folder of these tests, and how a page says where they come from."""


def test_pages_say_where_their_files_come_from():
    """Property: one line names the command or the page, where no block of the page makes a file."""
    for page in EXECUTED:
        text = page.read_text(encoding="utf-8")
        ran = "".join(block for kind, block in blocks(text) if kind in {"bash", "python"})
        for name, words in FOREIGN.items():
            first = re.search(rf"(--out )?(?<![\w/]){re.escape(name)}", ran)
            if first and not first[1]:
                assert words in text, f"{name_of(page)}: {name}"


def test_the_readme_is_short():
    """Property: what is longer has a page of docs/."""
    assert len(README.read_text(encoding="utf-8").splitlines()) <= LONGEST


def test_the_readme_runs_in_an_empty_folder(empty, monkeypatch, capsys):
    """Oracle: shell and interpreter; every line ends with exit code 0 and prints what is shown.

    It comes before the pages of docs/, which export its result.
    """
    monkeypatch.chdir(empty)
    printed = run_all(README, capsys)
    assert (empty / "results/first/report.html").exists()
    assert (empty / "results/first/identified.urdf").exists()
    assert "consistent: True" in printed


@pytest.mark.parametrize("page", [page for page in EXECUTED if page != README], ids=name_of)
def test_blocks_run(page, desk, request, monkeypatch, capsys):
    """Oracle: as for the README, in a folder with a URDF and a motion."""
    monkeypatch.chdir(desk)
    if page.stem in {"torch", "jax"}:
        pytest.importorskip(page.stem, reason=f"pip install 'symgen[{page.stem}]'")
    if page.name == "free-base.md":
        text = (DATA / "hopper.urdf").read_text(encoding="utf-8")
        legs = request.getfixturevalue("hopper").folder
        shutil.copytree(legs, desk / "generated/go2")
        walk = virtual_log(text, ("left_foot",), 3, Experiment(count=400, torque_noise=0.003))
        commanded = {"tau_command" if key == "tau" else key: x for key, x in walk.arrays.items()}
        np.savez(desk / "walk.npz", **commanded)
    printed = run_all(page, capsys)
    if page.name == "free-base.md":
        # 9.81 m/s² times the masses of the file
        weight = 9.81 * sum(map(float, re.findall(r'<mass value="([^"]+)"', text)))
        assert f"force z: {weight:.2f} N" in printed
    if page.name == "payload.md":
        assert "identified 1.000" in printed
    if page.name == "when-to-stop.md":
        assert "kg on link 7" in printed
    if page.name == "index.md":
        assert (desk / "results/mine/report.html").exists()
        assert (desk / "results/mine/identified.urdf").exists()


STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-Wno-unused-parameter")


def test_c_block_compiles_and_runs(desk):
    """Oracle: the weight of seven unit masses on joint 2 of the FR3 at home is not zero.

    Without optimisation; the test below compiles the same files with it and the same warnings.
    """
    if shutil.which("cc") is None:
        pytest.skip("SKIPPED LOUDLY: no C compiler called cc on this machine")
    folder = desk / "generated/fr3"
    flags = [*STRICT, "-O0"]
    run(["cc", *flags, "-c", str(folder / "kernels.c"), "-o", "kernels.o"], desk)
    for block in shown("c"):
        source = desk / "main.c"
        source.write_text(block, encoding="utf-8")
        run(["cc", *flags, f"-I{folder}", str(source), "kernels.o", "-o", "main", "-lm"], desk)
        torque = [float(word) for word in run([str(desk / "main")], desk).split()]
        assert len(torque) == 7
        assert torque[0] == 0.0  # vertical axis: gravity has no moment about it
        assert abs(torque[1]) > 1.0


def test_cpp_block_compiles_and_runs(desk, fr3):
    """Oracle: the weight of a unit mass at link 7 on joint 2 of the FR3, from the C code."""
    if shutil.which("g++") is None:
        pytest.skip("SKIPPED LOUDLY: no C++ compiler called g++ on this machine")
    folder = desk / "generated/fr3"
    q, pi = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0]), np.zeros(70)
    pi[[10, 60]] = 1.0
    weight = fr3.inverse_dynamics(q, 0 * q, 0 * q, pi)[1]
    for block in shown("cpp"):
        source = desk / "main.cpp"
        source.write_text(block, encoding="utf-8")
        flags = ("-std=c++11", "-Wall", "-Wextra", "-Werror", "-O0")
        run(["g++", *flags, f"-I{folder}", str(source), "-o", "main"], desk)
        assert float(run([str(desk / "main")], desk)) == pytest.approx(weight, abs=1e-3)


ONE_BY_ONE = """import os, subprocess, sys
usual, os.environ["PATH"] = {0!r}, {1!r}
flags = [word for word in sys.argv[1:] if word.startswith("-") and word[:2] != "-l"]
rest = [word for word in sys.argv[1:] if word not in flags]
for k, word in enumerate(rest):
    if word.endswith(".c"):
        rest[k] = f"{{k}}.o"
        subprocess.run([*usual, *flags, "-c", word, "-o", rest[k]], check=True)
subprocess.run([*usual, *flags, *rest], check=True)
"""
"""What `cc` does with a line of sources, flags and libraries."""


def test_line_of_the_c_block_compiles_in_an_empty_folder(tmp_path, monkeypatch):
    """Oracle: the README's own line, with the `symgen` of this tree on the path.

    A `cc` of the same path adds that every warning is an error, and takes the files of the line one
    by one, since a compiler cache knows no others.
    """
    if shutil.which("cc") is None:
        pytest.skip("SKIPPED LOUDLY: no C compiler called cc on this machine")
    (tmp_path / "main.c").write_text(shown("c")[0], encoding="utf-8")
    command = tmp_path / "symgen"
    command.write_text(f"#!{sys.executable}\nfrom symgen.cli.console import main\nmain()\n")
    command.chmod(0o755)
    strict = tmp_path / "cc"
    # The path without the folder of this program: a compiler cache searches the compiler there.
    usual = [shutil.which("cc"), *STRICT], os.environ["PATH"]
    strict.write_text(f"#!{sys.executable}\n{ONE_BY_ONE.format(*usual)}", encoding="utf-8")
    strict.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    (line,) = re.findall(r"^`(cc -O1 [^`]+)`", README.read_text(encoding="utf-8"), re.MULTILINE)
    run(["/bin/sh", "-c", f"{line} && ./a.out"], tmp_path)


REST_OF_A_RECIPE = """[time]
rate_hz = 100.0
[position]
unit = "rad"
columns = ["q_0", "q_1"]
"""
"""What a block that shows the table of currents leaves out."""


def test_toml_blocks_are_read(tmp_path, fr3):  # noqa: PLR0912  # one branch per kind of file
    """Property: recipe, controller, prior, robot and mechanism are read without complaint."""
    write_motion(Trajectory(fr3.home, 0.1 * np.ones((7, 2)), 5.0), fr3, tmp_path / "motion.json")
    path = tmp_path / "shown.toml"
    kinds = []
    for block in shown("toml"):
        path.write_text(block, encoding="utf-8")
        if "[position]" in block or 'unit = "A"' in block:
            kinds.append("recipe")
            rest = "" if "[position]" in block else REST_OF_A_RECIPE
            path.write_text(rest + block, encoding="utf-8")
            recipe = load_recipe(path)
            assert recipe.torque is not None or recipe.law is not None
        elif "law = " in block:  # beside arrays that are read without a recipe
            kinds.append("law")
            assert load_recipe(path).law is not None
        elif "leave_out" in block or "[extra." in block:
            recipe = load_recipe(path)
            kinds.append("signals" if recipe.extra else "intervals")
            assert len(recipe.leave_out) == 2 or len(recipe.extra["temperature"].columns) == 7
        elif "[controller]" in block:
            kinds.append("controller")
            assert read_controller(path, fr3).rotor.shape == (7,)
        elif "armature_from" in block:
            kinds.append("armature")
            assert set(tomllib.loads(block)) == {"armature_from", "armature"}
        elif "[centre]" in block or "trust" in block:
            known = read_prior(path, fr3)
            kinds.append("prior" if known.friction is None else "type")
            assert len(known.constraints.bounds) > 4 or known.friction.columns == ("viscous",)
        elif "[[link]]" in block:
            kinds.append("rows")
            assert read_source(Source(path), Mechanism())[1].coupling[0].joint == "coupler_joint"
        elif "[[coupling]]" in block or "[[loop]]" in block:
            mechanism = read_mechanism(path)
            kinds.append("loop" if mechanism.loop else "mechanism")
            assert mechanism.loop or len(mechanism.spring) == 2
        elif "entry-points" in block:
            kinds.append("plugin")
        elif block.startswith("friction ="):
            kinds.append("settings")
            assert stated_settings(IdentifySettings, [str(path)])["cutoff"] in {"10", "10.0"}
        elif "[[obstacle]]" in block:
            kinds.append("obstacles")
            assert [body.name for body in read_obstacles(path)] == ["camera post", "ball"]
        else:
            kinds.append("robot")
            assert read_config(path).home is not None
    recipes = {"recipe", "law", "intervals", "signals"}
    others = {"armature", "controller", "prior", "plugin", "robot", "mechanism", "loop", "rows"}
    assert set(kinds) == recipes | others | {"type", "obstacles", "settings"}


def test_methods_table_is_what_its_script_prints(shared_data):
    """Real data: the figures of the table, within what another BLAS may round differently."""
    assert (shared_data / "data/panda_gaz").is_dir()
    printed = run([sys.executable, "scripts/methods_table", "panda"], ROOT).removeprefix("panda\n")
    marks = "<!-- methods_table panda -->\n", "<!-- /methods_table panda -->"
    number = re.compile(r"\d+\.\d+")
    for page in (README, ROOT / "docs/benchmarks.md"):
        table = page.read_text(encoding="utf-8").split(marks[0])[1].split(marks[1])[0]
        assert number.sub("x", printed) == number.sub("x", table)
        pairs = zip(number.findall(printed), number.findall(table), strict=True)
        # 0.06: the descent stops when the loss stalls, and rounding moves it by a few steps.
        assert all(abs(float(a) - float(b)) <= 0.06 + 0.2 * float(b) for a, b in pairs)
