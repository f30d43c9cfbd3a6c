"""A xacro file computes the text of a robot: it runs no code, ends, and reads its packages only."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from runtime.common.child import Limits
from symgen.chain.mechanism import Mechanism
from symgen.errors import BuildError
from symgen.ros.packages import Packages, expanded
from symgen.ros.xacro_child import evaluate
from symgen.sources import Source, read_source

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("xacro") is None,
    reason="SKIPPED LOUDLY: the package xacro is not installed",
)
HEAD = '<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">'
SHORT = Limits(seconds=1, patience=30.0, memory=2**28)

CODE = (
    "().__class__",
    "[x.__class__ for x in [1]]",
    "(lambda: ().__class__)()",
    "(lambda g: [x.gi_frame for x in g])([(y for y in [1])])",
    "'{0.__class__}'.format(1)",
    "list(map(str.format, ['{0.__class__}'], [1]))",
    "python.vars(1)",
    "python.type(int)",
    "python.type(python.len)",
    "python.__builtins__",
    "python.root",
    "math.sin.__self__",
    "__import__('os')",
    "__attribute__",
    "(lambda __attribute__: 1)(1)",
    "dict(__builtins__=1)",
    "(a := 1)",
    "open('/etc/passwd')",
    "xacro.load_yaml.f_globals",
)
"""Ways out of expressions; each gave an object of the interpreter, or would on other versions."""


def written(folder: Path, body: str) -> Path:
    path = folder / "robot.xacro"
    path.write_text(f"{HEAD}{body}</robot>")
    return path


def refusal(folder: Path, body: str) -> str:
    with pytest.raises(BuildError) as caught:
        expanded(written(folder, body), {}, Packages(), SHORT)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_no_expression_runs_code(tmp_path: Path) -> None:
    """Property: nineteen ways to the interpreter are refused, by the names that xacro offers."""
    program = (
        "import json, sys, xacro, xacro.substitution_args as s; from pathlib import Path\nfrom "
        "symgen.ros.packages import Packages\nfrom symgen.ros.xacro_child import Files, "
        "confine\nconfine(xacro, s, Files(Path('x/robot.xacro'), Packages()))\nanswers = []\nfor "
        "text in json.load(sys.stdin):\n    try: answers.append(repr(xacro.safe_eval(text, "
        "xacro.Table(xacro._global_symbols))))\n    except (ValueError, NameError, AttributeError, "
        "TypeError): answers.append('')\nprint(json.dumps(answers))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program],
        input=json.dumps(CODE),
        capture_output=True,
        text=True,
        check=True,
    )
    answers = json.loads(run.stdout)
    assert dict(zip(CODE, answers, strict=True)) == dict.fromkeys(CODE, "")


def test_the_eval_of_arguments_runs_no_code(tmp_path: Path) -> None:
    """Property: $(eval …) had every built-in function of Python."""
    mark = tmp_path / "hacked"
    body = f"""<link name="$(eval ${{'open(&quot;{mark}&quot;,&quot;w&quot;\\x29'}})"/>"""
    assert "name 'open' is not defined" in refusal(tmp_path, body)
    assert not mark.exists()


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ('<link name="${9**9**9}"/>', "a power of at most 4096 bits"),
        ('<link name="${max(range(10**12))}"/>', "more than 1 s of processor time"),
        ('<link name="${len([0] * 10**9)}"/>', "more than 256 MiB of memory"),
        (
            '<xacro:macro name="m" params=""><xacro:m/><xacro:m/></xacro:macro><xacro:m/>',
            "nested without end",
        ),
        ('<xacro:include filename="robot.xacro"/>', "nested without end"),
    ],
    ids=["power", "max", "list", "macro", "include"],
)
def test_an_expansion_ends(tmp_path: Path, body: str, sentence: str) -> None:
    """Property: expressions and macros without end are one sentence within the limits; a power is
    refused before it is computed.
    """
    assert sentence in refusal(tmp_path, body)


def test_only_files_of_the_packages_are_read(tmp_path: Path) -> None:
    """Property: includes and YAML tables of other folders, devices and secrets are refused; those
    of the package of the file, of the setting package and of $(find …) are read.
    """
    (tmp_path / "secret.yaml").write_text("{word: 5}")
    inside = tmp_path / "arm"
    (inside / "urdf").mkdir(parents=True)
    table = "${xacro.load_yaml('%s')['word']}"
    body = '<link name="a%s"/>'
    assert "--settings package=DIR" in refusal(inside, body % (table % "../secret.yaml"))
    (inside / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    assert "--settings package=DIR" in refusal(inside, body % (table % "link.yaml"))
    assert "--settings package=DIR" in refusal(inside, '<xacro:include filename="/dev/zero"/>')
    assert "not the name of a ROS package" in refusal(inside, body % "$(find ../arm)")
    assert "MY_TOKEN" in refusal(inside, body % "$(optenv MY_TOKEN no)$(env MY_TOKEN)")
    path = written(inside, body % (table % "../secret.yaml"))
    assert '<link name="a5"/>' in expanded(path, {}, Packages((tmp_path,)), SHORT)
    (tmp_path / "package.xml").write_text("<package/>")
    assert '<link name="a5"/>' in expanded(path, {}, Packages(), SHORT)


def test_expressions_of_published_robots() -> None:
    """Property: what descriptions use works: methods, tables, comprehensions, functions."""
    names: dict[str, Any] = {"name": "left_arm", "pi": 3.0, "d": {"x": [1, 2]}, "len": len}
    for text, value in (
        ("name.split('_')[0].upper()", "LEFT"),
        ("[v * 2 for v in d['x'] if v > 1]", [4]),
        ("(lambda v: -v)(pi) if not False else 0", -3.0),
        ("' '.join([f'{k}_{len(v)}' for k, v in d.items()])", "x_2"),
        ("'%.2f' % (pi / 2)", "1.50"),
        ("d.get('y', 1e-3)", 1e-3),
        ("2**10 - pi**2 + (-1)**(10**9) + 10**-2", 1016.01),
    ):
        assert evaluate(f" {text} ", {**names, "str": str}) == value


def test_messages_of_a_file_are_lines_of_the_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Property: at most twenty lines, without what a terminal would interpret."""
    body = r"""<link name="a${xacro.warning('no mass of', 'b\x1b[2J')}"/>"""
    more = "${[xacro.message('again') for k in range(9999)] and ''}"
    expanded(written(tmp_path, f'{body}<link name="c{more}"/>'), {}, Packages(), Limits())
    assert caplog.messages[0] == "xacro: warning: no mass of b [2J"
    assert len(caplog.messages) == 20
    assert caplog.messages[-1] == "xacro: again"


def test_the_build_reads_a_source_within_limits(tmp_path: Path) -> None:
    """Property: read_source takes the same way."""
    path = written(tmp_path, '<link name="${[x.__class__ for x in [1]]}"/>')
    with pytest.raises(BuildError, match="two underscores are not for expressions"):
        read_source(Source(path), Mechanism())
