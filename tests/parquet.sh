#!/usr/bin/env bash
# Parquet files as other people's readers see them: pyarrow, polars and pandas from the Python registry, in an environment of their own
# under target/. A minute; needs python3 with venv.
set -eu
cd "$(dirname "$0")/.."
cargo build --release --quiet
command="$PWD/target/release/polhode"
environment=target/parquet-readers
[ -x "$environment/bin/python" ] || python3 -m venv "$environment"
"$environment/bin/pip" install --quiet pyarrow polars pandas
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp tests/files/parquet_study.toml "$work/packed.toml"
sed 's/"parquet"/"csv"/' "$work/packed.toml" > "$work/plain.toml"
for study in plain packed; do
    "$command" run "$work/$study.toml" --out "$work/$study" --engine cpu --quiet
done
"$environment/bin/python" tests/parquet.py "$work/plain" "$work/packed"
