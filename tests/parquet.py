"""Reads the Parquet files of a run with pyarrow, polars and pandas, and compares them with its CSV files, number by number.

    bash tests/parquet.sh
"""

import csv
import json
import math
import pathlib
import struct
import sys

import pandas
import polars
import pyarrow.parquet


def bits(number):
    return struct.pack("<d", math.nan if math.isnan(number) else number)


def cells(path):
    """Columns of a CSV file, as text."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return {name: [row[place] for row in rows[1:]] for place, name in enumerate(rows[0])}


def same(found, expected, where):
    """Whether a column's values are those that the text says."""
    assert len(found) == len(expected), f"{where}: {len(found)} rows, not {len(expected)}"
    for row, (value, text) in enumerate(zip(found, expected)):
        if isinstance(value, str):
            equal = value == text
        elif value is None or (text == "" and math.isnan(value)):
            equal = text == ""
        else:
            equal = bits(float(value)) == bits(float(text))
        assert equal, f"{where}, row {row}: {value!r}, not {text}"


def main(plain, packed):
    stems = sorted(path.stem for path in plain.glob("*.csv"))
    assert stems == sorted(path.stem for path in packed.glob("*.parquet")), "the same tables"
    count = 0
    for stem in stems:
        expected, path = cells(plain / f"{stem}.csv"), packed / f"{stem}.parquet"
        arrow = pyarrow.parquet.read_table(path)
        frames = {"pyarrow": arrow.to_pydict(), "polars": polars.read_parquet(path).to_dict(as_series=False)}
        frame = pandas.read_parquet(path)
        frames["pandas"] = {name: frame[name].tolist() for name in frame.columns}
        for reader, columns in frames.items():
            assert list(columns) == list(expected), f"{stem}, {reader}: {list(columns)}"
            for name, values in columns.items():
                same(values, expected[name], f"{stem}, {reader}, {name}")
                count += len(values)
        metadata = {key.decode(): value.decode() for key, value in arrow.schema.metadata.items()}
        assert metadata["polhode.study"] == (packed.parent / "packed.toml").read_text(), stem
        assert set(json.loads(metadata["polhode.columns"])) == set(expected), stem
        assert metadata == polars.read_parquet_metadata(path) | metadata, stem
    print(f"{len(stems)} tables, {count} values: equal by pyarrow {pyarrow.__version__}, "
          f"polars {polars.__version__}, pandas {pandas.__version__}")


if __name__ == "__main__":
    main(*map(pathlib.Path, sys.argv[1:]))
