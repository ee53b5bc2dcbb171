#!/usr/bin/env bash
# What writing costs: runs with and without tables, in alternation, and the same bytes written by dd, which computes nothing. By hand, five
# minutes: bash tests/streaming.sh [RUNS, 5]
#
# Prints medians: wall time, processor time (user and system), and how much more of each the tables take; of dd its wall and processor time.
set -eu
cd "$(dirname "$0")/.."
runs="${1:-5}"
[ -n "${POLHODE:-}" ] || cargo build --release --quiet
command="${POLHODE:-$PWD/target/release/polhode}"
desk="$(mktemp -d -p "${DESK:-$PWD/target}")"
trap 'rm -rf "$desk"' EXIT
cd "$desk"

# 300,000 driven bodies for SPAN seconds; $2 stands in [time].
driven() {
    cat <<STUDY
seed = 7
[bodies]
count = 300_000
inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }
orientation = { distribution = "uniform" }
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 0.02 }
[[torque]]
model = "gravity-gradient"
mu = 3.986004418e14
orbit = { radius = 7.0e6 }
[[torque]]
model = "linear-drag"
coefficient = { distribution = "uniform", low = 1e-5, high = 1e-4 }
[time]
end = $1
$2
[accuracy]
$3
[output]
STUDY
}
none='final = false\nstatistics = ["spin_rate"]\n'
final='final = true\nformat = "%s"\n'
snapshots='final = false\nsnapshots = true\nformat = "%s"\n'
studies=()
# A name, the study up to [output], the tables, their format.
study() {
    local name="$1" text="$2" tables="$3" format="$4"
    # shellcheck disable=SC2059
    { printf '%s\n' "$text"; printf "$none"; } >"$name-none.toml"
    # shellcheck disable=SC2059
    { printf '%s\n' "$text"; printf "$tables" "$format"; } >"$name-some.toml"
    studies+=("$name")
}
asked='attitude = 1e-6'
study final-parquet "$(driven 600.0 '' "$asked")" "$final" parquet
study final-csv "$(driven 600.0 '' "$asked")" "$final" csv
study each-20-minutes-parquet "$(driven 7200.0 'outputs = { every = 1200.0 }' "$asked")" "$snapshots" parquet
study each-2-minutes-parquet "$(driven 3600.0 'outputs = { every = 120.0 }' "$asked")" "$snapshots" parquet
study each-2-minutes-npz "$(driven 3600.0 'outputs = { every = 120.0 }' "$asked")" "$snapshots" npz
study each-16-steps-of-rk4 "$(driven 960.0 'outputs = { every = 32.0 }' $'method = "rk4"\ndt = 2.0')" "$snapshots" parquet

measured() {
    local out="$1"
    shift
    python3 - "$@" <<'PYTHON' >>"$out"
import os, resource, subprocess, sys, time
begun = time.perf_counter()
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
of_children = resource.getrusage(resource.RUSAGE_CHILDREN)
print(time.perf_counter() - begun, of_children.ru_utime + of_children.ru_stime)
PYTHON
}
for name in "${studies[@]}"; do
    for _ in $(seq "$runs"); do
        for which in none some; do
            rm -rf out
            measured "$name-$which.times" "$command" run "$name-$which.toml" --out out --engine cpu --quiet
        done
        table="$(echo out/final.* out/snapshots.* | tr ' ' '\n' | grep -v '\*')"
        bytes="$(stat -c %s "$table")"
        measured "$name-dd.times" dd if=/dev/zero of=out/bytes bs=1M count="$((bytes / 1048576 + 1))" conv=fsync
    done
    python3 - "$name" "$bytes" <<'PYTHON'
import statistics, sys
name, size = sys.argv[1], int(sys.argv[2]) / 1e6
def medians(which):
    rows = [[float(number) for number in line.split()] for line in open(f"{name}-{which}.times")]
    return [statistics.median(column) for column in zip(*rows)]
(wall, used), (more_wall, more_used), (dd_wall, dd_used) = medians("none"), medians("some"), medians("dd")
print(f"{name}: {size:.0f} MB; wall {wall:.2f} -> {more_wall:.2f} s ({100 * (more_wall / wall - 1):+.0f} %), "
      f"processor {used:.2f} -> {more_used:.2f} s ({100 * (more_used / used - 1):+.0f} %); dd {dd_wall:.2f} s, {dd_used:.2f} s", flush=True)
PYTHON
done
