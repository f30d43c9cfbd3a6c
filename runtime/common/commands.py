"""The commands of `symgen`, `python -m runtime` and `python -m symgen`, imported when they run.

The two packages of commands never import each other, so modules are named as text. `symgen --help`
prints the sentences of the list; the help of one command comes from its docstring.
"""

import errno
import io
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from inspect import getdoc
from typing import Annotated, Any, ClassVar

import typer
from typer.core import TyperCommand, TyperGroup

from runtime.common.errors import RuntimeFault
from runtime.common.settings import Choices, as_function, choices_of, record_of, stated_settings
from runtime.common.terminal import VERBOSE, as_typed, flowing

_KEPT = "files that were finished before stay as they are"
INTERRUPTED = 130  # exit code of Typer for Ctrl-C, where no method returns its best result so far
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # errors of an output that is full
SMALLEST_NUMBER, LARGEST_NUMBER = 1e-12, 1e12  # of options, besides 0 [SI]: else overflow
CONTEXT = {"help_option_names": ["-h", "--help"]}
_PLAIN = {"pretty_exceptions_enable": False, "rich_markup_mode": "rich"}
_LOOK: dict[str, Any] = _PLAIN | {"context_settings": CONTEXT}


@dataclass(frozen=True, slots=True)
class Command:
    """One line of the overview; NAME_command of the module runs it."""

    name: str  # word after `symgen`
    module: str  # module of its function
    sentence: str  # first sentence of the command's own help
    argument: str = ""  # what distinguishes two commands of one name

    @property
    def package(self) -> str:
        """Package of the command, symgen or runtime."""
        return self.module.partition(".")[0]


def _build(module: str, name: str, sentence: str, argument: str = "") -> Command:
    return Command(name, f"symgen.cli.{module}", sentence, argument)


def _run(name: str, sentence: str, argument: str = "", module: str = "") -> Command:
    return Command(name, f"runtime.cli.{module or name}", sentence, argument)


GROUPS: dict[str, tuple[Command, ...]] = {  # all commands in the order of the overview
    "Build the library of a robot": (
        _build("make", "build", "Generate and compile the C library of a robot arm."),
        _build(
            "make", "check", "Compare generated files with the C code that symgen writes today."
        ),
        _build("show", "list", "List bundled and generated robots."),
        _build("show", "describe", "Show joints, limits, base parameters and kernels of a robot."),
        _build(
            "proxies", "proxies", "Fit collision capsules to a robot and choose the pairs to check."
        ),
        _build("show", "clean", "Delete compiled libraries and generated folders."),
    ),
    "Check the input": (
        _build("inspect", "inspect", "Check the inertial parameters of a robot model.", "MODEL"),
        _run("inspect", "Check a log and propose a recipe that reads it.", "LOG"),
        _run("locate", "Print the folder of a known data set or of a robot.", module="bundled"),
    ),
    "Plan a motion": (
        _run("excite", "Design an excitation motion within all limits of a robot."),
        _run("approach", "Plan the way to the start of a motion and back.", module="motion_output"),
        _run("predict", "Predict the accuracy that a motion or a log allows."),
        _run("simulate", "Simulate the log of a robot with known parameters."),
        _run(
            "campaign",
            "Design, run and identify until a target is reached, on a virtual or real arm.",
        ),
    ),
    "Identify": (
        _run("identify", "Identify the inertial parameters of a robot from logs."),
        _run(
            "friction",
            "Identify friction anew and keep the links of an earlier result.",
            module="evaluate",
        ),
        _run("payload", "Identify mass, centre of mass and inertia of a payload.", module="gains"),
        _run("gains", "Identify gain and bias of every torque sensor or drive."),
        _run("fleet", "Compute the prior of a type of robot from many units of it."),
        _run(
            "compare", "Compare all identification methods on logs, or two results with each other."
        ),
    ),
    "Use a result": (
        _run("evaluate", "Evaluate an identified model on another log."),
        _run("observe", "Compute the external torque of a log and find contacts."),
        _run("watch", "Test whether a robot has changed since its model was identified."),
        _run("sample", "Draw models from the posterior of an identification.", module="export"),
        _run("export", "Export an identified model to simulators and controllers."),
        _run("report", "Write the results of a folder as one HTML page."),
        _run("rerun", "Repeat the run of a result and compare the digits."),
        _run("undo", "Bring the result back that the last run replaced.", module="rerun"),
        _run("view", "Show the moving robot in a web browser."),
    ),
    "Learn": (
        _run("tutorial", "Show a tutorial.", module="bundled"),
        Command(
            "reproduce",
            "runtime.experiments.command",
            "Reproduce the tables and figures of the document.",
        ),
    ),
}


class CheckedCommand(TyperCommand):
    """A command with settings beside its options, which refuses numbers of absurd size."""

    record: type[Choices] | None = None  # its choices; None for a command that takes none
    settings: Sequence[Any] = ()  # parameters that stand in --settings only

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the command line and the settings that it names."""
        if "--verbose" in args:
            VERBOSE.set(True)
        args = [str(word) for word in args if word != "--verbose"]
        if self.record is not None:
            self._require_options(args)
            args = self._with_settings(ctx, args)
        rest: list[str] = super().parse_args(ctx, args)
        for param in self.settings:
            try:
                param.handle_parse_result(ctx, {}, [])
            except typer.BadParameter as error:
                raise RuntimeFault(
                    f"the setting '{key_of(param)}': {error.message[:200].rstrip('.')}; correct it"
                ) from None
        for param in self.params:
            if param.param_type_name == "option" and param.name in ctx.params:
                _require_usual(param.opts[0], ctx.params[param.name])
        for param in self.settings:
            _require_usual(f"the setting {key_of(param)}", ctx.params[param.name])
        return rest

    def _require_options(self, args: list[str]) -> None:
        """Refuse an option that is a setting or an argument, and say how it is written."""
        taken = {option for p in self.params if p.param_type_name == "option" for option in p.opts}
        arguments = {f"--{p.name}" for p in self.params if p.param_type_name == "argument"} - taken
        for word in args[: args.index("--")] if "--" in args else args:
            name = word.partition("=")[0]
            if name in arguments:
                raise RuntimeFault(
                    f"{self.name} takes {name[2:].upper()} as a word alone; leave out {name}"
                )
            for param in self.settings:
                if name in (*param.opts, *param.secondary_opts):
                    key = key_of(param)
                    off = name in param.secondary_opts
                    value = ("false" if off else "true") if param.is_flag else "VALUE"
                    raise RuntimeFault(
                        f"{name} is a setting of {self.name}; give --settings {key}={value}, or "
                        f"{key} = … in the TOML file of --settings"
                    )

    def _with_settings(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the values of --settings as defaults; the words of arguments that are missing."""
        if not any(word.partition("=")[0] == "--settings" for word in args):
            return args
        values, _, _ = self.make_parser(ctx).parse_args(list(args))
        record = self.record
        stated = stated_settings(record, values.get("settings") or ()) if record else {}
        arguments = [p for p in self.params if p.param_type_name == "argument"]
        if not any(values.get(str(p.name)) for p in arguments):
            given = [stated.get(str(p.name)) for p in arguments]
            words = [w for v in given if v for w in (v if isinstance(v, list) else [v])]
            args = [*args, *(["--"] if "--" not in args else []), *words]
        ctx.default_map = stated
        return args


def key_of(param: Any) -> str:
    """Key of a parameter in a file of settings."""
    return str(param.opts[0]).removeprefix("--").replace("-", "_")


def _require_usual(option: str, value: Any) -> None:
    """Refuse numbers of an option, alone or with commas, beyond the smallest and the largest."""
    for each in value if isinstance(value, (list, tuple)) else [value]:
        for word in str(each).split(",") if isinstance(each, (str, float)) else []:
            with suppress(ValueError):  # a name
                size = abs(float(word))
                if 0 < size < SMALLEST_NUMBER or size > LARGEST_NUMBER:
                    raise RuntimeFault(
                        f"{option} expects a number from {SMALLEST_NUMBER:g} to "
                        f"{LARGEST_NUMBER:g} in size, got {word[:40]}; give it in SI units"
                    )


def imported(command: Command) -> Any:
    """Command of Typer, from its module."""
    function = getattr(import_module(command.module), f"{command.name}_command")
    app = typer.Typer(add_completion=False, **_LOOK)
    help_text = flowing(getdoc(function) or "")
    app.command(command.name, cls=CheckedCommand, help=help_text)(as_function(function))
    made = typer.main.get_command(app)
    if isinstance(made, CheckedCommand) and (record := record_of(function)):
        hidden = {each.name for each in choices_of(record)} - set(record.options.split())
        made.record = record
        made.settings = [
            p for p in made.params if p.name in hidden and p.param_type_name == "option"
        ]
        made.params = [p for p in made.params if p not in made.settings]
        if made.settings:
            keys = ", ".join(map(key_of, made.settings))
            made.epilog = f"Further settings, by --settings: {keys}."
    return made


class _Imports(Mapping[str, Any]):
    """Commands by name, each imported when it is looked up."""

    def __init__(self, listed: Sequence[Command]) -> None:
        self._commands = {command.name: command for command in listed}

    def __getitem__(self, name: str) -> Any:
        return imported(self._commands[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._commands)

    def __len__(self) -> int:
        return len(self._commands)


class Commands(TyperGroup):
    """Commands of one package, or of all, of which only the one that runs is imported.

    Args:
        ctx: of the call.
        args: words of the command line, the command first.
        formatter: of the library; the overview is printed by rich.
        incomplete: beginning of a word.
        named: commands of the name.
        words: words behind the name.
    """

    package: ClassVar[str] = ""  # package of the commands; empty for all

    def __init__(self, **attributes: Any) -> None:
        """A group without commands of its own."""
        super().__init__(**attributes)
        self._groups = {
            head: [command for command in group if command.package.startswith(self.package)]
            for head, group in GROUPS.items()
        }
        self.listed = [command for group in self._groups.values() for command in group]
        self.commands = _Imports(self.listed)  # type: ignore[assignment]  # nothing is added

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words before the command; without any word the overview is printed.

        Returns:
            Words that are left.
        """
        rest: list[str] = super().parse_args(ctx, args or ["--help"])
        return rest

    def list_commands(self, ctx: Any) -> list[str]:
        """Names of all commands."""
        return list(self.commands)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the overview."""
        self._overview().format_help(ctx, formatter)

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Names of commands that begin so.

        Returns:
            Items of the library.
        """
        overview = self._overview(with_arguments=False)
        with overview.make_context(ctx.info_name, [], resilient_parsing=True) as context:
            return overview.shell_complete(context, incomplete)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Import the command of a command line.

        Returns:
            Name, command and further words.
        """
        named = [command for command in self.listed if command.name == args[0]]
        if named or ctx.resilient_parsing:
            return args[0], imported(self.chosen(ctx, named, args[1:])) if named else None, args[1:]
        near = get_close_matches(args[0], list(self.commands), 1, 0.0) or list(self.commands)
        raise RuntimeFault(
            f"expected a command such as '{near[0]}', got '{args[0]}'; "
            f"run: {ctx.find_root().info_name} --help"
        )

    def chosen(self, ctx: Any, named: Sequence[Command], words: Sequence[str]) -> Command:
        """Command that runs, of those of one name.

        Returns:
            One of them.
        """
        return named[0]

    def _overview(self, with_arguments: bool = True) -> TyperGroup:
        """The same group with the sentences in place of the commands."""
        lines: dict[str, Any] = {}
        for head, group in self._groups.items():
            for command in group:
                twice = sum(other.name == command.name for other in self.listed) > 1
                argument = command.argument if twice and with_arguments else ""
                title = f"{command.name} {argument}".strip()
                lines[title] = TyperCommand(title, help=command.sentence, rich_help_panel=head)
        return TyperGroup(
            name=self.name,
            commands=lines,
            params=self.params,
            help=self.help,
            epilog=self.epilog,
            rich_markup_mode=self.rich_markup_mode,
        )


def application(
    group: type[Commands], purpose: str, version: str, add_completion: bool = False
) -> typer.Typer:
    """Application of a group of commands that states a purpose; the group imports the commands."""

    def print_version(ctx: typer.Context, requested: bool) -> None:
        if requested:
            print(f"{str(ctx.find_root().info_name).split()[-1]} {version}")
            raise typer.Exit

    def options(
        version: Annotated[
            bool,
            typer.Option(
                "--version", is_eager=True, callback=print_version, help="Print the version."
            ),
        ] = False,
        verbose: Annotated[
            bool, typer.Option("--verbose", help="Print the details of a result, too.")
        ] = False,
    ) -> None:
        """Options without a command."""
        VERBOSE.set(verbose)

    app = typer.Typer(
        cls=group,
        add_completion=add_completion,
        help=purpose,
        epilog="COMMAND --help describes a command with all its options.",
        **_LOOK,
    )
    app.callback()(options)
    return app


def run(app: typer.Typer, name: str) -> None:
    """Run a command line, then exit; a `RuntimeFault` becomes one sentence and exit code 2."""
    # With a hundred columns a second thread of BLAS only waits, and its waiting took four fifths of
    # a command's processor time. NumPy and worker processes read this when they start.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and not stream.encoding.lower().startswith("utf"):
            stream.reconfigure(errors="replace")  # a terminal without τ shows ?
    try:
        try:
            app()
        finally:
            sys.stdout.flush()
    except RuntimeFault as error:
        sentence = as_typed(str(error))
    except MemoryError as error:
        what = str(error).rstrip(".") or "no more is free"
        sentence = f"the memory does not suffice ({what}); give a shorter log or a lower rate"
    except OSError as error:
        if error.filename is not None:
            place = str(error.filename)
            short = place if len(place) <= 100 else place[:100] + "…"
            sentence = f"cannot use '{short}' ({error.strerror}); choose another path"
        elif error.errno in _FULL:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing is left over
            reason = error.strerror
            sentence = f"cannot write the output ({reason}); {_KEPT}; send it to another place"
        else:
            raise
    except SystemExit as end:
        if end.code == INTERRUPTED:
            print(f"{name}: interrupted; {_KEPT}", file=sys.stderr)
        raise
    else:
        return
    print(f"{name}: {sentence}", file=sys.stderr)
    raise SystemExit(2)
