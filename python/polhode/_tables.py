"""Tables of pandas, polars and Arrow, none of which need be installed."""

from __future__ import annotations

import numpy as np

from ._errors import InputError

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


def frame_to_columns(kind, columns):
    """A table of this kind of arrays of one axis."""
    columns = {name: np.ascontiguousarray(column) for name, column in columns.items()}
    if kind == "polars":
        import polars

        return polars.DataFrame(columns)
    if kind == "arrow":
        import pyarrow

        return pyarrow.table(columns)
    import pandas

    return pandas.DataFrame(columns, copy=False)
