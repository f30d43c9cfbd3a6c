"""Settings of a command: one record is its options, its keys in a file, and its keywords.

    @dataclass(frozen=True, slots=True, kw_only=True)
    class DesignSettings(Choices):
        options = "robot duration"
        robot: str = data_field("fr3", help="Name of a robot.")
        duration: float = method_field(10.0, help="Duration, s.")
        starts: int = method_field(5, help="Number of searches.", min=1)

    def design_command(given: DesignSettings) -> None: ...

A type that several records share is `Annotated` with the option instead, as `data_option` makes it.
The fields that `options` names, and arguments, stand on the command line. Each field has a key in
the file of --settings: the name of its option with `_` in place of `-`. The command line wins over
--settings, and a later --settings over an earlier one; NAME=VALUE of a key that takes several
values adds one. A key of text takes numbers and lists, too: `box = [0.2, 0.8]` is the text 0.2,0.8
of an option.
"""

import inspect
import textwrap
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import MISSING, dataclass, field, fields
from enum import Enum
from functools import partial
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, ClassVar, Union, get_args, get_origin, get_type_hints

import msgspec
import typer

from runtime.common.errors import RuntimeFault
from runtime.common.files import tables_of, toml_of, toml_value, write_text
from runtime.common.records import members_of, record_from_table

FILE = "settings.toml"  # name of the file beside a result
CONSENT = "yes"  # field that lets foreign code run: typed by the user, never taken from a file
data_option = partial(typer.Option, rich_help_panel="Data")
model_option = partial(typer.Option, rich_help_panel="Model")
output_option = partial(typer.Option, rich_help_panel="Output")
"""Choices by what they are for, the panel of the help; `typer.Option` is one of the method."""
OTHER = "Method"
_TYPER = "typer"  # key of the metadata of a field: what Typer reads
_WIDEST = 97  # characters of a sentence in the file


def _choice(kind: Callable[..., Any]) -> Callable[..., Any]:
    """Fields of records of choices: default, `...` for none, names, and what Typer takes."""

    def of(default: Any = None, *names: str, **how: Any) -> Any:
        value = MISSING if default is ... else default
        return field(default=value, metadata={_TYPER: kind(*names, **how)})

    return of


method_field, data_field = _choice(typer.Option), _choice(data_option)
model_field, output_field = _choice(model_option), _choice(output_option)


def argument_field(default: Any = ..., **how: Any) -> Any:
    """A word without a name."""
    return _choice(typer.Argument)(default, **how)


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """All choices of a command."""

    command: ClassVar[str] = ""  # word after `symgen`, that of the class without Settings
    options: ClassVar[str] = ""  # fields that are options, with spaces; the others are settings

    def __init_subclass__(cls) -> None:
        cls.command = cls.__name__.removesuffix("Settings").lower()

    def values(self, *names: str) -> dict[str, Any]:
        """Values of some choices by name."""
        return {name: getattr(self, name) for name in names}

    def stated(self) -> dict[str, str]:
        """Choices other than their defaults: field → how it is written."""
        given = {}
        for choice in choices_of(type(self)):
            value = getattr(self, choice.name)
            if value != choice.default and value is not None and value != []:
                given[choice.name] = choice.written(value)
        return given

    def stated_beyond(self, names: Collection[str]) -> list[str]:
        """How the choices that are stated and not among some names are written."""
        return [written for name, written in self.stated().items() if name not in names]

    def write(self, result: Path) -> Path:
        """Write the complete record beside a result, a folder or a file."""
        place = settings_place(result)
        write_text(place, "\n".join((*_lines(self), "")))
        return place


def settings_place(result: Path) -> Path:
    """File of the settings of a result, a folder or a file."""
    return result.with_suffix(f".{FILE}") if result.suffix else result / FILE


@dataclass(frozen=True, slots=True)
class Choice:
    """One field of a record of choices."""

    name: str
    key: str  # in a file
    hint: Any  # its type, with what Typer reads
    kind: Any  # the type alone
    default: Any  # MISSING where a value is needed
    info: Any  # what Typer reads
    is_option: bool  # whether it stands on the command line

    @property
    def is_argument(self) -> bool:
        """Whether it is a word without a name."""
        return isinstance(self.info, typer.models.ArgumentInfo)

    @property
    def sentence(self) -> str:
        """First sentence of its help."""
        text = (self.info.help or "").replace("\\", "").partition(". ")[0]
        return textwrap.shorten(text.rstrip(".") + ".", _WIDEST, placeholder=" …")

    def written(self, value: Any = None) -> str:
        """The choice as messages name it."""
        flag = f"--{self.key.replace('_', '-')}"
        if not (self.is_option or self.is_argument):
            return f"the setting {self.key}"
        return flag.replace("--", "--no-", 1) if value is False else flag


def choices_of(record: type[Choices]) -> tuple[Choice, ...]:
    """The fields of a record in their order, arguments first."""
    hints = get_type_hints(record, include_extras=True)
    choices = []
    for one in fields(record):
        hint = hints[one.name]
        if _TYPER in one.metadata:
            hint = Annotated[hint, one.metadata[_TYPER]]
        kind, *notes = get_args(hint)
        info = next(each for each in notes if hasattr(each, "param_decls"))
        names = (info.default, *(info.param_decls or ()))  # Typer takes the first as a default
        declared = [each for each in names if isinstance(each, str) and each.startswith("--")]
        key = declared[0].partition("/")[0][2:] if declared else one.name
        default = one.default
        if default is MISSING and one.default_factory is not MISSING:
            default = one.default_factory()
        if default is False and not declared:  # without --no-NAME
            info.param_decls = (f"--{one.name.replace('_', '-')}",)
        key = key.replace("-", "_")
        if key != one.name and key in hints:  # an argument of that name
            key = one.name
        is_option = one.name in record.options.split()
        choices.append(Choice(one.name, key, hint, kind, default, info, is_option))
    return tuple(sorted(choices, key=lambda choice: not choice.is_argument))


def as_function(function: Callable[[Any], None]) -> Callable[..., None]:
    """The function of a record with one parameter per choice, as Typer reads it."""
    record = record_of(function)
    if record is None:
        return function

    def called(settings: list[str] | None = None, **values: Any) -> None:
        function(record(**values))

    parameters = []
    for choice in choices_of(record):
        if not choice.is_argument:
            choice.info.rich_help_panel = choice.info.rich_help_panel or OTHER
        default = inspect.Parameter.empty if choice.default is MISSING else choice.default
        parameters.append(_keyword(choice.name, choice.hint, default))
    if any(not (choice.is_option or choice.is_argument) for choice in choices_of(record)):
        parameters.append(_keyword("settings", _FILES, None))
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {each.name: each.annotation for each in parameters}
    called.__doc__ = function.__doc__
    return called


def _keyword(name: str, kind: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def record_of(function: Callable[..., Any]) -> type[Choices] | None:
    """Record that a command takes; None for a command without one."""
    kinds = [kind for kind in get_type_hints(function).values() if isinstance(kind, type)]
    return next((kind for kind in kinds if issubclass(kind, Choices)), None)


def _offered(ctx: typer.Context, incomplete: str) -> list[str]:
    """Keys that begin so, with the sign of a value."""
    record = getattr(ctx.command, "record", None)
    keys = (choice.key for choice in choices_of(record)) if record else ()
    return sorted(f"{key}=" for key in keys if key.startswith(incomplete))


_FILES = Annotated[
    list[str] | None,
    data_option(
        "--settings",
        metavar="FILE|NAME=VALUE",
        autocompletion=_offered,
        help="TOML of settings, such as settings.toml beside a result, or one setting; repeatable. "
        "Options win over it.",
    ),
]


def stated_settings(record: type[Choices], words: Sequence[str]) -> dict[str, Any]:
    """Fields that the words behind --settings state, files or NAME=VALUE; the last word counts."""
    values: dict[str, Any] = {}
    added: set[str] = set()  # fields with several values that words gave, not files
    for word in words:
        key, sign, text = word.partition("=")
        is_one = bool(sign) and key.replace("-", "_").isidentifier()
        if is_one:
            key = key.strip().replace("-", "_")
            table, where = {key: _parsed(record, key, text.strip())}, "--settings"
        else:
            table, where = _table_of(record, Path(word)), f"'{word}'"
        read = record_from_table(_schema(record), table, where, RuntimeFault, allows_infinite=True)
        for choice in choices_of(record):
            value = getattr(read, choice.name)
            if value is msgspec.UNSET:
                continue
            value = _as_typed(choice.kind, value)
            if is_one and isinstance(value, list):
                value = [*(values[choice.name] if choice.name in added else ()), *value]
            values[choice.name] = value
            (added.add if is_one else added.discard)(choice.name)
    return values


def _table_of(record: type[Choices], path: Path) -> dict[str, Any]:
    """Table of a file of settings, without the name of the command."""
    try:
        table = toml_of(path)
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise RuntimeFault(
            f"--settings expects a TOML file or NAME=VALUE, got '{path}' ({reason}); correct it"
        ) from None
    command = table.pop("command", record.command)
    if command != record.command:
        raise RuntimeFault(
            f"'{path}' has the settings of '{command}'; give those of '{record.command}', or take "
            f"out the key command"
        )
    if CONSENT in table:
        raise RuntimeFault(
            f"'{path}' has the key {CONSENT}, and consent to run code counts only where it is "
            f"typed; take it out and give --settings {CONSENT}=true"
        )
    return table


def _parsed(record: type[Choices], key: str, text: str) -> Any:
    """Value of NAME=VALUE: as TOML writes it, or a text without quotes."""
    kind = next((choice.kind for choice in choices_of(record) if choice.key == key), None)
    if kind is not None and _takes_text(kind) and not text.startswith(("[", '"', "'")):
        return text
    try:
        return tables_of(f"value = {text}")["value"]
    except ValueError:
        # Integers of up to 308 digits, as a float holds them, meet the bound of their setting.
        return int(text) if text.isdecimal() and len(text) <= 308 else text


def _takes_text(kind: Any) -> bool:
    return any(each in {str, Path} or get_origin(each) is list for each in members_of(kind))


def _schema(record: type[Choices]) -> type[msgspec.Struct]:
    """Struct of a table of settings, whose keys may all be left out."""
    listed = []
    for choice in choices_of(record):
        members = [each for each in members_of(choice.kind) if each is not NoneType]
        wide: Any = Union[tuple(members)]  # noqa: UP007  # of types that are known at run time
        if any(get_origin(each) is list for each in members):
            wide = str | float | list[str | float]
        elif _takes_text(choice.kind):
            wide = str | float | list[float | str]
        listed.append((choice.name, wide | msgspec.UnsetType, msgspec.UNSET))
    names = {choice.name: choice.key for choice in choices_of(record)}
    return msgspec.defstruct(
        record.__name__, listed, frozen=True, forbid_unknown_fields=True, rename=names
    )


def _as_typed(kind: Any, value: Any) -> Any:
    """Value of a file as Typer takes it from the command line."""
    if any(get_origin(each) is list for each in members_of(kind)):
        return [_text(each) for each in value] if isinstance(value, list) else [_text(value)]
    if isinstance(value, Enum):
        return value.value
    return _text(value) if _takes_text(kind) else value


def _text(value: Any) -> str:
    """A value as a word of the command line."""
    if isinstance(value, list | tuple):
        return ",".join(map(_text, value))
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)


def _lines(given: Choices) -> Iterator[str]:
    """Lines of the file: every key with its sentence; a key without a value is a comment."""
    yield "# Settings of the result beside this file; symgen rerun RESULT repeats it."
    yield f"# symgen {given.command} --settings FILE takes them; options win over the file."
    yield f"command = {toml_value(given.command)}"
    for choice in choices_of(type(given)):
        if choice.name == CONSENT:
            continue
        value = getattr(given, choice.name)
        yield ""
        yield f"# {choice.sentence}"
        yield f"# {choice.key} =" if value is None else f"{choice.key} = {toml_value(value)}"
