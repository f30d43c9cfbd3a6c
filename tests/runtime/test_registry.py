"""registry: records by name, built in or added by another package."""

from importlib import metadata
from types import SimpleNamespace

import pytest

from runtime import registry
from runtime.errors import RuntimeFault
from runtime.registry import Registry
from tests.plugins import install_toy


class Thing:
    """A record."""

    def __init__(self, name: str) -> None:
        self.name = name


ONE = Thing("one")
HERE = {"one": f"{__name__}:ONE"}


def things(monkeypatch: pytest.MonkeyPatch, **plugins: object) -> Registry[Thing]:
    points = [
        SimpleNamespace(name=name, value=f"toy:{name}", load=lambda v=value: v)
        for name, value in plugins.items()
    ]
    monkeypatch.setattr(registry, "entry_points", lambda group: points if group == "g" else [])
    return Registry("g", Thing, "thing", HERE)


def test_builtin_records_come_first_and_are_loaded_once(monkeypatch):
    """Property: order of the package, then plugins by name; one object per name."""
    two, three = Thing("two"), Thing("three")
    records = things(monkeypatch, two=two, three=three)
    assert list(records) == ["one", "three", "two"]
    assert records.records() == (ONE, three, two)
    assert "two" in records
    assert "four" not in records
    assert len(records) == 3


@pytest.mark.parametrize(
    ("plugins", "name", "message"),
    [
        ({}, "two", r"there is no thing 'two'; choose from one, or install the package"),
        ({"two": Thing("other")}, "two", r"'toy:two' expects to provide a Thing named 'two'"),
        ({"two": object()}, "two", r"got object; correct or uninstall"),
    ],
)
def test_wrong_names_and_plugins_are_refused(monkeypatch, plugins, name, message):
    """Property: an unknown name or a plugin of another kind is one sentence."""
    with pytest.raises(RuntimeFault, match=message):
        things(monkeypatch, **plugins)[name]


def test_a_plugin_never_replaces_a_builtin_record(monkeypatch):
    """Property: the package's own record keeps its name."""
    assert things(monkeypatch, one=Thing("one"))["one"] is ONE


def test_a_plugin_that_cannot_be_imported_is_one_sentence(monkeypatch):
    """Property: any failure of a plugin names it."""

    def load() -> object:
        raise ZeroDivisionError("inside")

    things(monkeypatch)
    point = SimpleNamespace(name="bad", value="bad:X", load=load)
    monkeypatch.setattr(registry, "entry_points", lambda group: [point])
    with pytest.raises(RuntimeFault, match=r"'bad:X' cannot be imported \(ZeroDivisionError"):
        Registry("g", Thing, "thing", HERE)["bad"]


def test_entry_points_of_python_are_asked_for():
    """Oracle: importlib.metadata knows no plugin of a group that nobody uses."""
    assert not metadata.entry_points(group="symgen.nothing")
    assert list(Registry("symgen.nothing", Thing, "thing", HERE)) == ["one"]


def test_groups_of_installed_packages_are_found(tmp_path, monkeypatch) -> None:
    """Property: a package that appears while Python runs counts in registries made later."""
    assert list(Registry("symgen.fruits", Thing, "thing", HERE)) == ["one"]
    install_toy(tmp_path, "symgen.fruits", "pear", "PEAR = 1\n", "PEAR")
    monkeypatch.syspath_prepend(tmp_path)
    assert list(Registry("symgen.fruits", Thing, "thing", HERE)) == ["one", "pear"]
