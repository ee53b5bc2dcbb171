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
cat > "$work/packed.toml" <<'STUDY'
title = "Boxes, some of them lost"
seed = 5
[bodies]
count = 30_000
inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.1 }
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 20.0 }
position = { distribution = "normal", mean = 0.0, sigma = 10.0 }
[[event]]
name = "slow"
quantity = "spin_rate"
falls_below = 29.0
[[histogram]]
quantity = "nutation"
low = 0.0
high = 1.6
bins = 8
[[torque]]
model = "linear-drag"
coefficient = { distribution = "uniform", low = 0.01, high = 0.1 }
[time]
end = 2.0
outputs = { every = 0.4 }
[accuracy]
method = "implicit_midpoint"
dt = 0.2
[output]
snapshots = true
initial = true
statistics = ["spin_rate", "dynamic_inertia"]
quantiles = [50]
format = "parquet"
[failures]
allow = 30_000
STUDY
sed 's/"parquet"/"csv"/' "$work/packed.toml" > "$work/plain.toml"
for study in plain packed; do
    "$command" run "$work/$study.toml" --out "$work/$study" --engine cpu --quiet
done
"$environment/bin/python" tests/parquet.py "$work/plain" "$work/packed"
