#!/bin/sh
# A study in as many parts as MPI starts processes. None of them speaks to another: MPI only starts them.
#
#     polhode plan study.toml --out plan.json
#     sh mpi.sh 16
#
# A part that has failed is run again alone: polhode run study.toml --plan plan.json --shard 3/16 --out parts
set -eu
parts="${1:-16}"
out="${OUT:-parts}"
mpirun -n "$parts" ${MPIRUN_OPTIONS:-} -x RAYON_NUM_THREADS="${THREADS:-1}" \
    polhode run "${STUDY:-study.toml}" --plan "${PLAN:-plan.json}" --shard auto --out "$out" --quiet
exec polhode merge "$out" --out "${RESULT:-study.out}"
