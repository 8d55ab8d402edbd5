"""What results share: words, a table for notebooks, arrays with units, a file."""

import abc
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Self

from ._errors import InputError
from ._html import html_table
from ._netcdf import load_netcdf, write_netcdf

TitledTable = tuple[str, Sequence[tuple], Sequence[str]]  # title, rows, header


class AbstractShown(abc.ABC):
    """A result that says itself in words, shows itself in a notebook, and gives its arrays out."""

    @abc.abstractmethod
    def sentences(self) -> list[str]:
        """The result in words, the answer first."""

    @abc.abstractmethod
    def tables(self) -> list[TitledTable]:
        """The tables that a notebook shows."""

    @abc.abstractmethod
    def to_xarray(self) -> Any:
        """An `xarray.Dataset` with a unit on every array."""

    def __repr__(self) -> str:
        return "\n".join(self.sentences())

    def _repr_html_(self) -> str:
        return "".join(html_table(*table) for table in self.tables())


class AbstractResult(AbstractShown):
    """A result of one table that survives saving in a netCDF file: `load(save(x)) == x`.

    It gives its arrays out (`to_xarray`) and takes them back in (`from_xarray`).  `file_kind` is
    what its files are marked with, `what` the word for it in messages.
    """

    file_kind: ClassVar[str]
    what: ClassVar[str]

    @abc.abstractmethod
    def table(self) -> TitledTable:
        """Title, rows and header of the table that a notebook shows."""

    @classmethod
    @abc.abstractmethod
    def from_xarray(cls, data: Any) -> Self:
        """The result of which `to_xarray` made `data`."""

    def tables(self) -> list[TitledTable]:
        """The one table."""
        return [self.table()]

    def save(self, path: str | Path) -> Path:
        """Write a netCDF file that `load` reads back equal; its path.

        Raises `InputError` where the file cannot be written.
        """
        return write_netcdf(self.to_xarray().assign_attrs(kind=self.file_kind), path)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The result that `save` wrote; `InputError` for a file that holds none of its kind."""
        data = load_netcdf(path, decode_times=True)
        if data.attrs.get("kind") != cls.file_kind:
            raise InputError(f"holds no {cls.what}.", path)
        return cls.from_xarray(data)


def texts(data: Any, name: str) -> tuple[str, ...]:
    """A coordinate of words."""
    return tuple(str(x) for x in data[name].values)
