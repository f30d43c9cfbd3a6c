"""Named records of one kind: those of this package and those that installed packages add.

A record is written in the module of the thing it describes. A registry holds where each record
lies, as `module:ATTRIBUTE`, and imports it at its first use. Another package adds one by
an entry point of the registry's group in its pyproject.toml:

    [project.entry-points."symgen.estimators"]
    ridge = "my_package.ridge:RIDGE"
"""

from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, Protocol, TypeVar

from runtime.common.errors import RuntimeFault


class Named(Protocol):
    """Anything with a name."""

    @property
    def name(self) -> str:
        """The word by which a user selects it."""


R = TypeVar("R", bound=Named)


class Registry(Generic[R]):
    """Records of one kind by name, in the order of the package, then those of plugins by name."""

    def __init__(
        self,
        group: str,
        kind: type[R],
        noun: str,
        builtin: Mapping[str, str],
        error: type[RuntimeFault] = RuntimeFault,
    ) -> None:
        """A registry whose built-in records are not imported yet; an unknown name is an `error`."""
        self.group, self.kind, self.noun, self._error = group, kind, noun, error
        self._builtin = dict(builtin)
        self._plugins: dict[str, EntryPoint] | None = None
        self._loaded: dict[str, R] = {}

    def __iter__(self) -> Iterator[str]:
        """Names of all records."""
        yield from self._builtin
        yield from self._entry_points()

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return name in self._builtin or name in self._entry_points()

    def __getitem__(self, name: str) -> R:
        """The record of this name."""
        if name not in self._loaded:
            self._loaded[name] = self._load(name)
        return self._loaded[name]

    @property
    def builtin(self) -> tuple[str, ...]:
        """Names of the records of this package."""
        return tuple(self._builtin)

    def records(self) -> tuple[R, ...]:
        """All records, every one imported."""
        return tuple(self[name] for name in self)

    def _load(self, name: str) -> R:
        if name in self._builtin:
            module, attribute = self._builtin[name].split(":")
            record: R = getattr(import_module(module), attribute)
            return record
        if name in self._entry_points():
            return self._plugin(name)
        raise self._error(
            f"there is no {self.noun} '{name}'; choose from {', '.join(self)}, or install the "
            "package that adds it"
        )

    def _plugin(self, name: str) -> R:
        point = self._entry_points()[name]
        try:
            record = point.load()
        except Exception as error:  # a plugin may fail in any way
            raise RuntimeFault(
                f"the {self.noun} '{name}' of the plugin '{point.value}' cannot be imported "
                f"({type(error).__name__}: {error}); correct or uninstall that package"
            ) from None
        if not isinstance(record, self.kind) or record.name != name:
            raise RuntimeFault(
                f"the plugin '{point.value}' expects to provide a {self.kind.__name__} named "
                f"'{name}', got {type(record).__name__}; correct or uninstall that package"
            )
        return record

    def _entry_points(self) -> dict[str, EntryPoint]:
        if self._plugins is None:
            points = sorted(entry_points(group=self.group), key=lambda point: point.name)
            self._plugins = {p.name: p for p in points if p.name not in self._builtin}
        return self._plugins
