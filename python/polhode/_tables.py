"""Tables of pandas, polars and Arrow, none of which need be installed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ._errors import InputError

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow

#: The columns of a table of bodies, in their order.
BODY_COLUMNS = ("mass", "ixx", "iyy", "izz", "ixy", "ixz", "iyz", "qx", "qy", "qz", "qw", "wx", "wy", "wz", "x", "y", "z", "vx", "vy", "vz")


def table_columns(table):
    """The columns of a table of bodies by their names, as arrays where the table has them as such."""
    if hasattr(table, "to_numpy") and hasattr(table, "columns"):
        # pandas and polars.
        names = [name for name in table.columns if name in BODY_COLUMNS]
        return {name: table[name].to_numpy() for name in names}
    if hasattr(table, "column_names") and hasattr(table, "column"):
        # Arrow.
        return {name: _of_arrow(table.column(name), name) for name in table.column_names if name in BODY_COLUMNS}
    names = getattr(getattr(table, "dtype", None), "names", None)
    if names:
        return {name: table[name] for name in names if name in BODY_COLUMNS}
    if hasattr(table, "keys"):
        return {name: table[name] for name in table.keys() if name in BODY_COLUMNS}
    if hasattr(table, "__arrow_c_stream__"):
        import pyarrow

        return table_columns(pyarrow.table(table))
    raise InputError(f"table: found {type(table).__name__}, expected a pandas, polars or Arrow table, a structured array or a dict of columns")


def _of_arrow(column, name):
    if column.null_count:
        raise InputError(f"column {name}: {column.null_count} values are null: expected numbers in all rows")
    return column.to_numpy()


class Tabular:
    """What can be had as a table."""

    def _columns(self):
        """Arrays of one axis by the names of their columns."""
        raise NotImplementedError

    def to_arrow(self) -> pyarrow.Table:
        """The table as `pyarrow.Table`."""
        columns = self._whole_columns()
        import pyarrow

        return pyarrow.table(columns)

    def to_polars(self) -> polars.DataFrame:
        """The table as `polars.DataFrame`."""
        columns = self._whole_columns()
        import polars

        return polars.DataFrame(columns)

    def to_pandas(self) -> pandas.DataFrame:
        """The table as `pandas.DataFrame`."""
        columns = self._whole_columns()
        import pandas

        return pandas.DataFrame(columns, copy=False)

    def _whole_columns(self):
        return {name: np.ascontiguousarray(column) for name, column in self._columns().items()}
