"""Results in a notebook: small HTML tables, whose texts are escaped, and data frames."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib import import_module
from typing import Any

from runtime.common.tables import Table
from runtime.errors import RuntimeFault


class Shown(ABC):
    """Tables of an object, as a notebook shows it."""

    __slots__ = ()

    @abstractmethod
    def tables(self) -> tuple[Table, ...]:
        """What a notebook shows."""

    def _repr_html_(self) -> str:
        return "\n".join(table.__html__() for table in self.tables())


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


class Framed(Shown):
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
