#!/usr/bin/env bash
# Runs a study in parts by each launcher of examples/launchers that is installed, and compares the merged tables with those of one run,
# byte by byte; says which launchers are missing. By hand, as these are not part of a development machine:
#
#     apt-get install openmpi-bin parallel slurm-wlm munge; pip install snakemake hyperqueue
#     bash tests/launchers.sh
#
# A Slurm of one node is set up for the test where slurmctld and slurmd are there, none is running and this is root.
set -u
cd "$(dirname "$0")/.."
launchers="$PWD/examples/launchers" support="$PWD/tests/support"
cargo build || exit 1
PATH="$(cargo metadata --format-version 1 --no-deps | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')/debug:$PATH"
desk="$(mktemp -d)"
trap 'rm -rf "$desk"' EXIT
passed=() failed=() missing=()

cat >"$desk/study.toml" <<'STUDY'
seed = 7
[bodies]
count = 5000
inertia = { moments = [1.0, 1.7, 2.2], scatter = 0.2 }
angular_velocity = { distribution = "normal", mean = 0.0, sigma = 1.0 }
[[torque]]
model = "linear-drag"
coefficient = { distribution = "uniform", low = 0.01, high = 0.1 }
[time]
end = 5.0
outputs = { every = 1.0 }
[output]
snapshots = true
statistics = ["kinetic_energy", "spin_rate"]
STUDY
cd "$desk" || exit 1
polhode run study.toml --out whole --quiet --engine cpu || exit 1
polhode plan study.toml --out plan.json --quiet --engine cpu || exit 1
whole="$(cd whole && sha256sum final.csv plan.json snapshots.csv statistics.csv)"

# Runs a launcher in a folder of its own and compares what it leaves.
check() {
    local name="$1"
    shift
    mkdir "$name" && cp study.toml plan.json "$name"
    if (cd "$name" && "$@") >"$name.log" 2>&1 && (cd "$name/study.out" && sha256sum --quiet -c <<<"$whole"); then
        passed+=("$name")
    else
        failed+=("$name")
        tail -n 20 "$name.log" | sed "s/^/  $name: /"
    fi
}

# One part is killed and run again alone, and one that was lost.
again() {
    sh "$launchers/parallel.sh" 6 && rm -rf study.out parts/shard-2-of-6 && mkdir parts/.shard-4-of-6.polhode-0123456789abcdef.partial &&
        rm -rf parts/shard-4-of-6 && test "$(polhode status parts --due)" = "2,4" && sh "$launchers/parallel.sh" 6
}

slurm() {
    local job=(sbatch --wait --chdir "$PWD" --export=ALL --cpus-per-task=1)
    PARTS=6 "${job[@]}" --array=1-6 "$launchers/slurm.sh" && rm -rf parts/shard-3-of-6 parts/shard-5-of-6 &&
        PARTS=6 "${job[@]}" --array="$(polhode status parts --due)" "$launchers/slurm.sh" &&
        polhode merge parts --out study.out --quiet
}

hyperqueue() {
    export HQ_SERVER_DIR="$PWD/server"
    hq server start &
    until hq server info >/dev/null 2>&1; do sleep 0.2; done
    hq worker start --cpus 2 &
    sh "$launchers/hyperqueue.sh" 6 && rm -rf study.out parts/shard-6-of-6 && sh "$launchers/hyperqueue.sh" 6
    local status=$?
    hq server stop
    wait
    return "$status"
}

# A controller and a daemon for this machine alone; gives back whether they answer.
start_slurm() {
    sinfo >/dev/null 2>&1 && return 0
    [ "$(id -u)" -eq 0 ] || return 1
    local host
    host="$(hostname -s)"
    mkdir -p "$desk/controller/state" "$desk/controller/spool" /run/munge /var/log/munge
    if ! pgrep -x munged >/dev/null; then
        [ -e /etc/munge/munge.key ] || mungekey -c
        chown munge /run/munge /var/log/munge
        su munge -s /bin/sh -c munged || return 1
    fi
    cat >"$desk/controller/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$host
SlurmUser=root
AuthType=auth/munge
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
StateSaveLocation=$desk/controller/state
SlurmdSpoolDir=$desk/controller/spool
SlurmctldPidFile=$desk/controller/slurmctld.pid
SlurmdPidFile=$desk/controller/slurmd.pid
SlurmctldLogFile=$desk/controller/slurmctld.log
SlurmdLogFile=$desk/controller/slurmd.log
ReturnToService=2
NodeName=$host CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$host Default=YES State=UP
CONF
    export SLURM_CONF="$desk/controller/slurm.conf"
    slurmctld -D >"$desk/controller/ctld.out" 2>&1 &
    slurm_processes=($!)
    slurmd -D >"$desk/controller/d.out" 2>&1 &
    slurm_processes+=($!)
    local attempt
    for attempt in $(seq 60); do
        sinfo -h -o %T 2>/dev/null | grep -q idle && return 0
        sleep 0.5
    done
    echo "  slurm: no answer: $(tail -n 3 "$desk/controller/ctld.out" "$desk/controller/d.out" | tr '\n' ' ')"
    return 1
}
slurm_processes=()

if command -v parallel >/dev/null; then
    check parallel sh "$launchers/parallel.sh" 6
    check parallel-again again
else
    missing+=(parallel)
fi
if command -v mpirun >/dev/null; then
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
    MPIRUN_OPTIONS=--oversubscribe check mpirun sh "$launchers/mpi.sh" 6
else
    missing+=(mpirun)
fi
if command -v snakemake >/dev/null; then
    check snakemake snakemake --snakefile "$launchers/Snakefile" --cores 2 --config parts=6
else
    missing+=(snakemake)
fi
# The Python package has HyperQueue's server and workers, but not its command.
if ! command -v hq >/dev/null && python3 -c "import hyperqueue" 2>/dev/null; then
    mkdir "$desk/bin"
    printf '#!/bin/sh\nexec python3 "%s" "$@"\n' "$support/hq.py" >"$desk/bin/hq"
    chmod +x "$desk/bin/hq"
    PATH="$desk/bin:$PATH"
fi
if command -v hq >/dev/null; then
    check hyperqueue hyperqueue
else
    missing+=(hyperqueue)
fi
if command -v sbatch >/dev/null && start_slurm; then
    check slurm slurm
    [ "${#slurm_processes[@]}" -eq 0 ] || kill "${slurm_processes[@]}"
else
    missing+=(slurm)
fi
wait

echo "the same tables by: ${passed[*]:-none}"
[ "${#missing[@]}" -eq 0 ] || echo "not installed, or not to be started here: ${missing[*]}"
[ "${#failed[@]}" -eq 0 ] || { echo "FAILED: ${failed[*]}"; exit 1; }
