"""Results in a notebook: small HTML tables, whose texts are escaped, and data frames."""

import html
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from typing import Any

from runtime.errors import RuntimeFault

Cells = Sequence[object]


def html_table(title: str, rows: Iterable[Cells], head: Cells = ()) -> str:
    """HTML of one table with a caption."""
    lines = ["<table>", f"<caption><b>{_text(title)}</b></caption>"]
    if head:
        cells = "".join(f"<th>{_text(cell)}</th>" for cell in head)
        lines.append(f"<thead><tr>{cells}</tr></thead>")
    lines.append("<tbody>")
    for first, *others in rows:
        cells = "".join(f"<td>{_text(cell)}</td>" for cell in others)
        lines.append(f'<tr><th scope="row">{_text(first)}</th>{cells}</tr>')
    return "\n".join([*lines, "</tbody>", "</table>"])


def frame(columns: Mapping[str, Any], package: str) -> Any:
    """Data frame of a package that is installed by the user."""
    try:
        module = import_module(package)
    except ModuleNotFoundError:
        raise RuntimeFault(
            f"a data frame of {package} needs that package, which is not installed; run: "
            f"pip install {package}"
        ) from None
    return module.DataFrame(dict(columns))


class Framed(ABC):
    """Conversion to data frames, for classes with `columns_of_frame`."""

    __slots__ = ()

    @abstractmethod
    def columns_of_frame(self) -> Mapping[str, Any]:
        """Title → values of the table."""

    def to_pandas(self) -> Any:
        """The table as a `pandas.DataFrame`."""
        return frame(self.columns_of_frame(), "pandas")

    def to_polars(self) -> Any:
        """The table as a `polars.DataFrame`."""
        return frame(self.columns_of_frame(), "polars")


def _text(value: object) -> str:
    return html.escape(str(value))
