#!/bin/sh
# A study as a Slurm array of parts. Before it, once:
#
#     polhode plan study.toml --out plan.json
#     sbatch --array=1-64 slurm.sh
#
# After it, what has failed or was killed, alone:
#
#     sbatch --array=$(polhode status parts --due) slurm.sh
#     polhode merge parts --out study.out
#
#SBATCH --job-name=polhode
#SBATCH --cpus-per-task=4
#SBATCH --output=part-%a.log
set -eu
export RAYON_NUM_THREADS="${SLURM_CPUS_PER_TASK:-0}"
# How many parts there are stands here, as an array that is run again in part does not say it.
exec polhode run "${STUDY:-study.toml}" --plan "${PLAN:-plan.json}" --shard "auto/${PARTS:-64}" --out "${OUT:-parts}" --quiet
