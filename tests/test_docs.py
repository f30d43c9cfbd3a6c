"""The documentation site: built without a warning, searchable, its notebooks run."""

import ast
import functools
import http.server
import inspect
import os
import pkgutil
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.browser import chromium
from tests.conftest import REPOSITORY
from tests.markdown import blocks

PAGES = [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").rglob("*.md"))]
NOTEBOOKS = ("own-robot", "payload")
SIZES = ((1400, 900), (400, 800))
SCHEMES = {"light": "default", "dark": "slate"}
"""Colours that the user prefers, and what the theme calls them."""
COLOURS = "data-md-color-scheme"
EXCESS = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
DRAWN = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
"""The page has answered to its new size."""
AT_ONCE = """addEventListener("DOMContentLoaded", () => {
    const style = document.createElement("style");
    style.textContent = "* { transition: none !important; animation: none !important }";
    document.head.append(style);
})"""
"""The theme's drawer and headings move in no time: they come to rest where they do in .25 s."""
NO_INDEX = {"config": {"lang": ["en"], "separator": " ", "pipeline": [], "fields": {}}, "docs": []}
"""Of pages on which nobody searches: a browser takes a second to read the one of the site."""
OF_SCRIPTS = {
    f"--{name}"
    for name in (
        *("update", "starts", "goals", "designs", "joints", "serve", "notebooks", "planted"),
        *("advice", "count", "first", "kind", "log", "help", "real", "map", "again", "free"),
        *("latest", "only", "resume", "serial", "compiled", "slopes", "adam"),
    )
}
"""Options of the programs in scripts/ that pages name."""
OF_CONSOLE = {"--install-completion", "--show-completion"}
"""Options of `symgen` without a command."""
ESCAPE = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")
"""Colours of a terminal."""
COMMANDS_IN_THE_KERNEL = """import shlex
import sys
from symgen.cli.console import main
shell = get_ipython()
in_a_process = shell.system
def system(line):
    words = shlex.split(line)
    if words[0] != "symgen":
        return in_a_process(line)
    sys.argv = words
    try:
        shell.user_ns["_exit_code"] = main() or 0
    except SystemExit as end:
        shell.user_ns["_exit_code"] = end.code or 0
shell.system = system
"""
"""First cell of a notebook under test: our commands run in the kernel, which imports once."""
LOOKED_AT = (
    "index.html",
    "benchmarks.html",
    "contributing.html",
    "how-it-compares.html",
    "howto/messages.html",
    "concepts/parameters.html",
    "howto/choose-a-method.html",
    "reference/commands.html",
    "reference/c.html",
    "reference/api.html",
    "reference/files.html",
)


def test_commands_of_console_blocks_exist() -> None:
    """Property: a command that is shown and not run has its name and options."""
    import typer.main

    import runtime.cli
    import symgen.cli

    groups = [typer.main.get_command(app).commands for app in (symgen.cli.app, runtime.cli.app)]
    checked = 0
    for page in PAGES:
        for language, block in blocks(page.read_text(encoding="utf-8")):
            lines = block.splitlines() if language == "console" else []
            for words in (line.split() for line in lines if line.startswith("symgen ")):
                if words[1] in OF_CONSOLE:
                    continue  # tests/test_console.py runs them
                params = [p for g in groups if words[1] in g for p in g[words[1]].params]
                known = {name for p in params for name in (*p.opts, *p.secondary_opts)}
                options = {word for word in words if word.startswith("--")}
                assert params, f"{page.name}: {' '.join(words)}"
                assert options <= known | {"--help"}, f"{page.name}: {' '.join(words)}"
                checked += 1
    assert checked > 15


def test_options_named_in_pages_exist() -> None:
    """Property: a page of the how-to section names no option that no command has."""
    import typer.main

    import runtime.cli
    import symgen.cli

    groups = [typer.main.get_command(app) for app in (symgen.cli.app, runtime.cli.app)]
    commands = [each for group in groups for each in (group, *group.commands.values())]
    params = [p for command in commands for p in command.params]
    known = (
        {name for p in params for name in (*p.opts, *p.secondary_opts)} | OF_SCRIPTS | OF_CONSOLE
    )
    for page in PAGES:
        named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", page.read_text(encoding="utf-8")))
        assert named <= known, f"{page.name}: {sorted(named - known)}"


def section_of(page: str, head: str) -> str:
    """Text below a heading of the second level."""
    text = (REPOSITORY / "docs" / page).read_text(encoding="utf-8")
    return text.split(f"\n## {head}\n")[1].split("\n## ")[0]


def names_of(text: str) -> set[str]:
    """Names in code marks."""
    return set(re.findall(r"`(\w[\w-]*)`", text))


def test_public_names_are_those_of_the_code() -> None:
    """Property: the page lists all names of runtime, commands, registries, formats and C."""
    import runtime
    from runtime.campaign.drivers import DRIVERS
    from runtime.common.commands import GROUPS
    from runtime.excitation.motion.trajectory import BASES
    from runtime.excitation.motion_export import MOTION_FORMATS
    from runtime.excitation.search.criteria import CRITERIA
    from runtime.outputs.model_files.export_format import EXPORT_FORMATS
    from runtime.recording.formats import FORMATS
    from runtime.recording.settings import COLUMNS

    page = "reference/public.md"
    python = section_of(page, "Python").replace("`runtime`", "")
    assert names_of(python) == set(runtime.__all__)
    commands = names_of(section_of(page, "Commands")) - {"symgen"}
    assert commands == {command.name for group in GROUPS.values() for command in group}
    rows = section_of(page, "Names that files and options take").splitlines()
    cells = {row.split("|")[3].strip(" `"): row.split("|")[2] for row in rows if "| `sym" in row}
    kinds = (runtime.METHODS, COLUMNS, FORMATS, CRITERIA, BASES, MOTION_FORMATS)
    for registry in (*kinds, EXPORT_FORMATS, DRIVERS):
        assert names_of(cells.pop(registry.group)) == set(registry.builtin), registry.group
    assert not cells
    header = (REPOSITORY / "generated/fr3/fr3.h").read_text(encoding="utf-8")
    declared = re.findall(r"^(?:void|int|const char \*) ?\*?fr3_(\w+)\(", header, re.MULTILINE)
    functions = {name for name in declared if not name.endswith("_batch")}
    assert names_of(section_of(page, "C")) == functions


def test_public_records_state_their_attributes() -> None:
    """Property: docstrings of exported records, which the API page shows, have every field."""
    import runtime

    count = 0
    for kind in (getattr(runtime, name) for name in runtime.__all__):
        if not (hasattr(kind, "__dataclass_fields__") or hasattr(kind, "__struct_fields__")):
            continue
        _, _, listed = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")
        items = re.findall(r"^ {4}(\w+(?:, \w+)*): \S", listed, re.MULTILINE)
        stated = {name for item in items for name in item.split(", ")}
        missing = {name for name in vars(kind)["__annotations__"] if name[0] != "_"} - stated
        assert not missing, f"{kind.__name__}: {missing}"
        count += 1
    assert count > 12


def test_numbers_of_public_formats_are_those_of_the_code() -> None:
    """Property: the page states the number that the code writes into each file."""
    from runtime.identification import result_record, statistics_file
    from runtime.identification.comparison import output
    from runtime.identification.payload import body
    from runtime.library import manifest

    table = section_of("reference/public.md", "Files")
    stated = dict(re.findall(r"\| `([\w.]+)` \| `\w+` (\d+) \|", table))
    assert stated == {
        "result.json": str(result_record.FORMAT),
        "payload.json": str(body.FORMAT),
        "compare.json": str(output.FORMAT),
        "statistics.npz": str(statistics_file.FORMAT),
        "manifest.json": str(manifest.FORMAT),
    }


def test_places_of_the_code_named_in_pages_exist() -> None:
    """Property: files and dotted names of the packages in code marks are there."""
    named = section_of("reference/public.md", "Names that files and options take")
    groups = re.findall(r"`(symgen\.\w+)`", named)  # of entry points
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        files = re.findall(r"`((?:runtime|symgen|scripts|tests|docs)/[\w./-]+)[`#]", text)
        wrong = [file for file in files if not (REPOSITORY / file).exists()]
        for name in {*re.findall(r"`((?:runtime|symgen)(?:\.\w+)+)[`(]", text)} - {*groups}:
            try:
                pkgutil.resolve_name(name)
            except (ImportError, AttributeError):
                wrong.append(name)
        assert not wrong, f"{page.name}: {wrong}"


def templates() -> Iterator[str]:
    """Every text of the code, with … in the place of what is inserted when it runs."""
    for folder in ("runtime", "symgen"):
        for path in (REPOSITORY / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.JoinedStr):
                    yield "".join(str(getattr(part, "value", "")) if isinstance(part, ast.Constant)
                                  else "…" for part in node.values)  # fmt: skip
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    yield node.value


def test_sentences_that_pages_quote_are_those_of_the_code() -> None:
    """Property: each sentence of the table of messages is part of one text of the code."""
    page = (REPOSITORY / "docs/howto/messages.md").read_text(encoding="utf-8")
    quoted = re.findall(r"^\| “(.+?)” \|", page, re.MULTILINE)
    assert len(quoted) >= 25
    texts = "\n".join(" ".join(text.split()) for text in templates())
    for sentence in quoted:
        parts = [re.escape(part) for part in sentence.strip("…").split("…")]
        assert re.search(".*".join(parts), texts), sentence


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site as `scripts/docs` builds it."""
    pytest.importorskip("mkdocs", reason="NO SITE: pip install 'symgen[docs]'")
    folder = tmp_path_factory.mktemp("site")
    words = ["build", "--strict", "--quiet", "-f", ".mkdocs.yml", "--site-dir", str(folder)]
    run = subprocess.run(
        [sys.executable, "-m", "mkdocs", *words],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return folder


@pytest.fixture(scope="module")
def address(site: Path) -> Iterator[str]:
    """The site behind a plain HTTP server."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            pass

    handler = functools.partial(Quiet, directory=str(site))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    thread.join()
    server.server_close()


def test_the_site_has_every_page(site: Path) -> None:
    """Property: pages that are written from the code are there, with their content."""
    commands = (site / "reference/commands.html").read_text(encoding="utf-8")
    for words in ("symgen identify", "symgen build", "symgen excite", "--cutoff"):
        assert words in commands
    names = (site / "reference/api.html").read_text(encoding="utf-8")
    assert "identify_payload" in names
    assert "Criterion" in names  # a record of plug-ins
    assert "fr3_mass_matrix" in (site / "reference/c.html").read_text(encoding="utf-8")
    for name in ("fr3", "own-robot", "payload", "realtime", "z1"):
        assert (site / f"tutorials/{name}.html").exists()


def test_the_site_in_a_browser(address: str) -> None:
    """Property: wide and narrow, light and dark: no overflow, no error, no other server, search."""
    with chromium() as browser:
        complaints: list[str] = []
        others: list[str] = []

        def opened(**options: object) -> Any:
            page = browser.new_page(**options)
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.on("request", lambda request: others.append(request.url))
            return page

        page = opened()
        page.route("**/search_index.json", lambda route: route.fulfill(json=NO_INDEX))
        page.add_init_script(AT_ONCE)
        resize = page.context.new_cdp_session(page)
        for name in LOOKED_AT:
            page.goto(f"{address}/{name}")
            for width, height in SIZES:
                size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
                resize.send("Emulation.setDeviceMetricsOverride", size)
                for colours in SCHEMES.values():  # as the theme's button does
                    page.evaluate(f"document.body.setAttribute('{COLOURS}', '{colours}')")
                    page.evaluate(DRAWN)
                    assert page.evaluate("innerWidth") == width
                    excess = page.evaluate(EXCESS)
                    assert excess <= 0, f"{name} at {width} px is {excess} px too wide"
        page.close()
        for scheme, colours in SCHEMES.items():
            page = opened(color_scheme=scheme)  # the theme keeps its first choice
            if scheme != [*SCHEMES][-1]:
                page.route("**/search_index.json", lambda route: route.fulfill(json=NO_INDEX))
            page.goto(f"{address}/index.html")
            assert page.evaluate(f"document.body.getAttribute('{COLOURS}')") == colours
        # `fill` sends no keyup: the theme would read the field 1 ms after its focus, filled or not
        page.locator(".md-search__input").first.press_sequentially("Stribeck")
        result = page.locator(".md-search-result__item a").first
        result.wait_for(timeout=120_000)  # the index of a busy machine
        assert "friction" in (result.get_attribute("href") or "")
        assert not complaints
        assert not [url for url in others if not url.startswith((address, "data:", "blob:"))]


def test_notebooks_are_those_of_the_tutorials() -> None:
    """Property: what is committed is what `scripts/docs --notebooks` writes."""
    pytest.importorskip("nbformat", reason="NO NOTEBOOKS: pip install 'symgen[docs]'")
    from scripts.site.notebooks import FOLDER, NAMES, text_of

    assert NAMES == NOTEBOOKS
    for name in NAMES:
        stored = (FOLDER / f"{name}.ipynb").read_text(encoding="utf-8")
        assert stored == text_of(name), f"{name}: run scripts/docs --notebooks"


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_runs(name: str, tmp_path: Path, fr3, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: a Jupyter kernel runs every cell; every shell line ends with exit code 0."""
    pytest.importorskip("nbclient", reason="NO NOTEBOOKS: pip install 'symgen[docs]'")
    pytest.importorskip("ipykernel", reason="NO NOTEBOOKS: pip install 'symgen[docs]'")
    import nbformat
    from nbclient import NotebookClient

    (tmp_path / "generated").mkdir()
    (tmp_path / "generated" / "fr3").symlink_to(fr3.folder)
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    notebook = nbformat.read(REPOSITORY / "docs/notebooks" / f"{name}.ipynb", as_version=4)
    for cell in notebook.cells:
        if cell.cell_type == "code" and cell.source.startswith("!"):
            lines = cell.source.splitlines()
            cell.source = "\n".join(f"{line}\nassert _exit_code == 0, _exit_code" for line in lines)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(COMMANDS_IN_THE_KERNEL))
    client = NotebookClient(
        notebook,
        timeout=300,
        resources={"metadata": {"path": str(tmp_path)}},
        kernel_name="python3",
    )
    client.execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    printed = [  # rich prints into a notebook by its display
        output["data"]["text/plain"]
        if output.output_type == "display_data"
        else output.get("text", "")
        for output in outputs
    ]
    shown = ESCAPE.sub("", "".join(printed))
    words = {"own-robot": "links: all 2 physically consistent", "payload": "identified 1.00"}[name]
    assert words in " ".join(shown.split())
    tables = [output.get("data", {}).get("text/html", "") for output in outputs]
    assert sum("<table " in table for table in tables) == 1  # the result shows itself


def test_scripts_docs_refuses_what_it_does_not_know(tmp_path: Path) -> None:
    """Property: one sentence and exit code 2."""
    shutil.copytree(REPOSITORY / "scripts", tmp_path / "scripts", ignore=lambda *_: ["__pycache__"])
    setup = tmp_path / "scripts/setup"
    setup.write_text("#!/bin/sh\n", encoding="utf-8")
    run = subprocess.run(
        [str(tmp_path / "scripts/docs"), "--pictures"], capture_output=True, text=True, check=False
    )
    assert run.returncode == 2
    assert "--serve" in run.stderr


def test_every_figure_is_drawn_and_committed(tmp_path: Path, monkeypatch, fr3) -> None:
    """Property: the script of the figures runs, and docs/images has each for both schemes."""
    (tmp_path / "generated").mkdir()
    (tmp_path / "generated" / "fr3").symlink_to(fr3.folder)
    monkeypatch.chdir(tmp_path)
    from scripts.site.figures import FIGURES, IMAGES, SCHEMES, draw

    for name in FIGURES:
        assert b"<svg" in draw(name, "light", tmp_path).read_bytes()
        assert all((IMAGES / f"{name}-{scheme}.svg").exists() for scheme in SCHEMES)
