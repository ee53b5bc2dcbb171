#!/usr/bin/env bash
# The command under valgrind, which finds reads and writes outside of what was allocated: bodies in lanes by every method in both
# precisions, adaptive steps, series, closed forms, noise, moving centres, statistics, tables and pictures. A minute on one core.
#
#     bash tests/valgrind.sh
#
# Values without a meaning are not looked for: optimised code may read them as long as nothing follows from them.
set -eu
cd "$(dirname "$0")/.."
cargo build --release --quiet
command="$PWD/target/release/polhode"
desk=$(mktemp -d)
trap 'rm -rf "$desk"' EXIT
cd "$desk"
# Not a multiple of any number of lanes.
study() {
    printf '%s\n' '[bodies]' 'count = 67' 'inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }' 'mass = 2.0' \
        'orientation = { distribution = "uniform" }' 'angular_velocity = { distribution = "normal", mean = 0, sigma = 0.5 }' \
        '[time]' 'end = 0.3' "$@" '[output]' 'snapshots = true' 'statistics = ["kinetic_energy"]'
}
runs=0
run() {
    study "${@:2}" > study.toml
    if ! RAYON_NUM_THREADS=2 valgrind -q --undef-value-errors=no --error-exitcode=99 \
        "$command" run study.toml --force --engine cpu --quiet 2> errors; then
        printf 'not clean: %s\n' "$1"
        cat errors
        exit 1
    fi
    runs=$((runs + 1))
}
drag=('[[torque]]' 'model = "linear-drag"' 'coefficient = 0.1' '[[torque]]' 'model = "constant-world"' 'torque = [0, 0, 0.1]')
# The command names all that it knows.
methods="$(study '[accuracy]' 'method = "none"' 'dt = 0.01' > study.toml && "$command" explain study.toml 2>&1 | sed 's/.*possible: //; s/,//g' || true)"
for method in $methods; do
    [ "$method" = taylor ] && continue
    for precision in f32 f64; do
        run "$method in $precision" '[accuracy]' "method = \"$method\"" 'dt = 0.01' "precision = \"$precision\"" "${drag[@]}"
    done
done
for precision in f32 f64; do
    run "rk8 adaptive in $precision" '[accuracy]' 'method = "rk8"' 'tolerance = 1e-6' "precision = \"$precision\"" "${drag[@]}"
    run "closed form in $precision" '[accuracy]' 'attitude = 1e-5' "precision = \"$precision\""
done
run "series" '[accuracy]' 'method = "taylor"' 'tolerance = 1e-9' "${drag[@]}"
run "a plan" "${drag[@]}" '[[torque]]' 'model = "custom"' 'torque = "-0.1 * angular_velocity"'
run "noise" '[accuracy]' 'method = "splitting4"' 'dt = 0.01' '[[torque]]' 'model = "white-noise"' 'intensity = 0.02'
run "centres" '[[force]]' 'model = "quadratic-drag"' 'coefficient = 0.3'
echo "$runs runs: nothing read or written out of bounds"
