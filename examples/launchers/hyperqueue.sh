#!/bin/sh
# A study as an array of HyperQueue tasks, on workers that are started already:
#
#     polhode plan study.toml --out plan.json
#     sh hyperqueue.sh 64
#
# What is there already is left as it is, so the same command runs again what has failed or was killed.
set -eu
parts="${1:-64}"
out="${OUT:-parts}"
due="1-$parts"
if [ -d "$out" ]; then
    due="$(polhode status "$out" --due || true)"
fi
if [ -n "$due" ]; then
    hq submit --wait --array "$due" --cpus "${CPUS:-1}" --env RAYON_NUM_THREADS="${CPUS:-1}" \
        polhode run "${STUDY:-study.toml}" --plan "${PLAN:-plan.json}" --shard "auto/$parts" --out "$out" --quiet
fi
exec polhode merge "$out" --out "${RESULT:-study.out}"
