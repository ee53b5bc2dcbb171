#!/bin/sh
# A study in parts by GNU parallel, as many at a time as there are cores, one thread each:
#
#     polhode plan study.toml --out plan.json
#     sh parallel.sh 64
#
# --retries runs a part again that has failed; --sshlogin takes machines that share the folder.
set -eu
parts="${1:-64}"
out="${OUT:-parts}"
export RAYON_NUM_THREADS=1
seq "$parts" | parallel --halt now,fail=20% --retries 2 \
    polhode run "${STUDY:-study.toml}" --plan "${PLAN:-plan.json}" --shard "{}/$parts" --out "$out" --quiet
exec polhode merge "$out" --out "${RESULT:-study.out}"
