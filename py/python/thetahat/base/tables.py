"""Results as data frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from thetahat.base.clock import imported


class Table:
    """What goes to a data frame: columns of the same length."""

    _index: ClassVar[str | None] = None
    """The column that tells the rows apart, of which a frame of pandas makes its index."""

    def _columns(self) -> Mapping[str, Any]:
        raise NotImplementedError

    def to_pandas(self) -> Any:
        """A data frame of pandas.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        frame = imported("pandas").DataFrame(dict(self._columns()))
        return frame if self._index is None else frame.set_index(self._index)

    def to_polars(self) -> Any:
        """A data frame of Polars; what is an index in pandas is its first column.

        Raises
        ------
        ImportError
            If Polars is not installed.
        """
        polars = imported("polars")
        return polars.DataFrame([polars.Series(name, values, strict=False) for name, values in self._columns().items()])


class Records(dict[str, Any], Table):
    """A part of a document, which is a dict, with a list of its entries as the rows of a frame.

    A dict within an entry gives its own columns; a list is written as a text.
    """

    def __init__(self, document: Mapping[str, Any], rows: str) -> None:
        super().__init__(document)
        self._rows = rows

    def _columns(self) -> dict[str, list[Any]]:
        rows = [dict(_flat(entry)) for entry in self[self._rows]]
        return columns(rows)

    def __reduce__(self) -> tuple[Any, ...]:
        return (Records, (dict(self), self._rows))


def columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """The columns of rows, in the order in which they first come; None where a row has none."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row.get(name) for row in rows] for name in names}


def _flat(entry: Mapping[str, Any]) -> Any:
    for name, value in entry.items():
        if isinstance(value, Mapping):
            yield from _flat(value)
        elif isinstance(value, (list, tuple)):
            yield name, ", ".join(map(str, value)) if len(value) != 1 else value[0]
        else:
            yield name, value
