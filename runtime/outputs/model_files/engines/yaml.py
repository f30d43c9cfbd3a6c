"""Read YAML files by PyYAML."""

from typing import Any

from runtime.outputs.model_files.engines.answer import Unreadable

INSTALL = "pip install pyyaml"


def tables_of(text: str) -> dict[str, Any] | None:
    """Tables of a YAML file; None where PyYAML is not installed."""
    try:
        import yaml
    except ImportError:
        return None
    try:
        tables = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise Unreadable(str(error)) from None
    if not isinstance(tables, dict):
        raise Unreadable("no tables")
    return tables
