"""Data classes whose methods are closures instead of compiled source.

`dataclasses.dataclass` writes the source of six methods for a frozen class and compiles it. With
the hundred and more classes of a command that took a tenth of its processor time. Here fields,
defaults and slots are those of the standard library, so `replace`, `fields`, `asdict`, `field` and
type checkers work as usual; `__init__`, `__repr__`, `__eq__`, `__hash__` and the two methods that
refuse a change are one function each, which keeps the fields of its class.
"""

import dataclasses
from collections.abc import Callable
from inspect import Parameter, Signature
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass
else:

    def dataclass(
        cls: type | None = None,
        /,
        *,
        frozen: bool = False,
        slots: bool = False,
        eq: bool = True,
        kw_only: bool = False,
    ) -> Any:
        """Decorate a class as `dataclasses.dataclass` does.

        Args:
            cls: class with annotated fields.
            frozen: True refuses to set and to delete attributes.
            slots: True keeps no dictionary in its instances.
            eq: True compares instances by their fields, and hashes frozen ones by them.
            kw_only: True takes fields by name only.

        Returns:
            The class, a new one with slots; without `cls` the decorator.
        """

        def decorated(cls: type) -> type:
            made = dataclasses.dataclass(
                cls, init=False, repr=False, eq=False, slots=slots, kw_only=kw_only
            )
            written = set(vars(made))
            for name, method in _methods(made, frozen, slots, eq).items():
                if name not in written:
                    setattr(made, name, method)
            if eq and not _has_hash(cls):
                made.__hash__ = _hash(made) if frozen else None
            return made

        return decorated if cls is None else decorated(cls)


class _SignatureOfFields:
    """The signature of a class from its fields, made when it is read."""

    def __get__(self, instance: object, owner: type) -> Signature:
        if instance is not None:  # signature(instance) is that of its __call__
            raise AttributeError("__signature__")
        return _signature(owner)


_SIGNATURE = _SignatureOfFields()


def _signature(cls: type) -> Signature:
    """Parameters in the order of the fields, those by name only last."""
    parameters = [
        Parameter(
            field.name,
            Parameter.KEYWORD_ONLY if field.kw_only else Parameter.POSITIONAL_OR_KEYWORD,
            default=_default(field),
            annotation=field.type,
        )
        for field in dataclasses.fields(cls)
        if field.init
    ]
    return Signature(sorted(parameters, key=lambda one: one.kind), return_annotation=None)


def _default(field: "dataclasses.Field[Any]") -> Any:
    """Default of a parameter; that of a factory shows the factory."""
    if field.default is not dataclasses.MISSING:
        return field.default
    factory = field.default_factory
    return Parameter.empty if factory is dataclasses.MISSING else factory


def _methods(cls: type, frozen: bool, slots: bool, eq: bool) -> dict[str, Any]:
    """Methods that the class gets where it does not define them."""
    fields = dataclasses.fields(cls)
    methods: dict[str, Any] = {"__init__": _init(cls, fields), "__signature__": _SIGNATURE}
    methods["__repr__"] = _repr([field.name for field in fields if field.repr])
    if eq:
        methods["__eq__"] = _eq(_values(cls))
    if frozen:
        methods |= _refusals(cls, frozenset(field.name for field in fields))
    if frozen and slots:
        methods |= {"__getstate__": _getstate, "__setstate__": _setstate}
    return methods


def _init(cls: type, fields: "tuple[dataclasses.Field[Any], ...]") -> Callable[..., None]:
    """`__init__` that sets fields by place or by name, then calls `__post_init__`."""
    missing = dataclasses.MISSING
    places = tuple(field.name for field in fields if field.init and not field.kw_only)
    names = {field.name for field in fields if field.init}
    defaults = {field.name: field.default for field in fields if field.default is not missing}
    factories = {
        field.name: field.default_factory
        for field in fields
        if field.default_factory is not missing
    }
    required = names - defaults.keys() - factories.keys()
    has_check = hasattr(cls, "__post_init__")
    set_field = object.__setattr__

    def __init__(self: Any, /, *values: Any, **named: Any) -> None:
        given = dict(zip(places, values, strict=False))
        if len(values) > len(places) or not given.keys().isdisjoint(named):
            _signature(cls).bind(*values, **named)  # raises with the reason
        given |= named
        if not required <= given.keys() <= names:
            _signature(cls).bind(*values, **named)
        for name, value in defaults.items():
            if name not in given:
                set_field(self, name, value)
        for name, factory in factories.items():
            if name not in given:
                set_field(self, name, factory())
        for name, value in given.items():
            set_field(self, name, value)
        if has_check:
            self.__post_init__()

    return __init__


def _values(cls: type) -> Callable[[Any], tuple[Any, ...]]:
    """Map from an instance to the values that are compared."""
    names = [field.name for field in dataclasses.fields(cls) if field.compare]
    if len(names) > 1:
        return attrgetter(*names)
    return lambda instance: tuple(getattr(instance, name) for name in names)


def _eq(values: Callable[[Any], tuple[Any, ...]]) -> Callable[[Any, Any], Any]:
    def __eq__(self: Any, other: Any) -> Any:
        if other.__class__ is not self.__class__:
            return NotImplemented
        return self is other or values(self) == values(other)

    return __eq__


def _has_hash(cls: type) -> bool:
    """Whether the class defines it; Python adds None where only `__eq__` is defined."""
    written = vars(cls)
    return "__hash__" in written and (written["__hash__"] is not None or "__eq__" not in written)


def _hash(cls: type) -> Callable[[Any], int]:
    values = _values(cls)

    def __hash__(self: Any) -> int:
        return hash(values(self))

    return __hash__


def _repr(names: list[str]) -> Callable[[Any], str]:
    @recursive_repr()
    def __repr__(self: Any) -> str:
        shown = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"{self.__class__.__qualname__}({shown})"

    return __repr__


def _refusals(cls: Any, names: frozenset[str]) -> dict[str, Any]:
    """Methods of a frozen class; a subclass without fields may set attributes of its own."""

    def __setattr__(self: Any, name: str, value: Any) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        super(cls, self).__setattr__(name, value)

    def __delattr__(self: Any, name: str) -> None:
        if type(self) is cls or name in names:
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        super(cls, self).__delattr__(name)

    return {"__setattr__": __setattr__, "__delattr__": __delattr__}


def _getstate(self: Any) -> list[Any]:
    """Values of all fields, for pickle and copy, which cannot set attributes of a frozen class."""
    return [getattr(self, field.name) for field in dataclasses.fields(self)]


def _setstate(self: Any, state: list[Any]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)
