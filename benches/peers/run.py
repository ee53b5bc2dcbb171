"""Times polhode beside heyoka, numba and SciPy: the same bodies, the same equations, errors against the same truth.

    python3 -m venv benches/peers/.venv && benches/peers/.venv/bin/pip install -r benches/peers/requirements.txt
    benches/peers/.venv/bin/python benches/peers/run.py

Programs take turns: in each round every program runs once at every tolerance. The README beside this file says
what is charged.
"""

import argparse
import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parent.parent
PROGRAMS = ("polhode", "taylor", "rk8", "heyoka", "numba", "SciPy")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add(
        "--problems",
        nargs="+",
        metavar="NAME",
        help="of free, forced, heavy-top, gradient, kepler, orbit [default: all]",
    )
    add(
        "--targets",
        nargs="+",
        type=float,
        metavar="RAD",
        help="errors of the table, rad [default: 1e-3 to 1e-13, every decade]",
    )
    add("--bodies", nargs="+", type=int, default=[4096, 131072], help="sizes of the ensemble [default: 4096 131072]")
    add("--rounds", nargs="+", type=int, default=[5, 3], help="rounds, one number a size [default: 5 3]")
    add(
        "--programs",
        nargs="+",
        choices=PROGRAMS,
        default=PROGRAMS,
        metavar="NAME",
        help=f"of {', '.join(PROGRAMS)} [default: all]",
    )
    add("--threads", type=int, default=1, help="threads of every program but SciPy [default: 1]")
    add("--cores", nargs="+", type=int, help="cores to stay on, by number [default: the last that are allowed]")
    add(
        "--clock",
        choices=("wall", "cpu"),
        default="wall",
        help="wall time, or processor time on a busy machine [default: wall]",
    )
    add(
        "--pinned-up-to",
        type=int,
        default=4096,
        metavar="BODIES",
        help="greatest ensemble for polhode's pinned methods [default: 4096]",
    )
    add(
        "--subset",
        type=int,
        default=8192,
        metavar="BODIES",
        help="numba runs at most so many bodies of an ensemble [default: 8192]",
    )
    add(
        "--sample",
        type=int,
        default=1024,
        metavar="BODIES",
        help="bodies whose errors are measured; SciPy runs these alone [default: 1024]",
    )
    add("--polhode", type=Path, default=REPOSITORY / "target/release/polhode", metavar="PATH", help="the command")
    add("--commit", help="the commit that the command was built from [default: the repository's]")
    add(
        "--limit",
        type=float,
        default=120,
        metavar="S",
        help="a run of polhode that takes longer is stopped [default: 120]",
    )
    add("--note", default="", help="a sentence for the table, such as what else the machine did")
    add(
        "--output",
        type=Path,
        metavar="DIR",
        help="folder for peers.csv, peers.md and the pictures [default: benches/results/<machine>]",
    )
    add("--only-plot", action="store_true", help="make tables and pictures again from peers.csv")
    add("--readme", action="store_true", help="write the short table into the repository's README, between its marks")
    chosen = parser.parse_args()
    if len(chosen.rounds) == 1:
        chosen.rounds *= len(chosen.bodies)
    if len(chosen.rounds) != len(chosen.bodies):
        parser.error("--rounds: one number, or as many as --bodies has")
    if min(chosen.bodies) < chosen.sample:
        parser.error(f"--bodies: at least the {chosen.sample} of --sample")
    if not chosen.only_plot and not chosen.polhode.is_file():
        parser.error("--polhode: no such file; `cargo build --release` in the repository makes target/release/polhode")
    return chosen


def main():
    chosen = arguments()
    # Libraries read these when they are loaded, so they come before the imports.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = str(chosen.threads)
    if not chosen.only_plot and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, chosen.cores or sorted(os.sched_getaffinity(0))[-chosen.threads :])
    # Beside this file, wherever it is called from.
    sys.path.insert(0, str(HERE))
    import report

    chosen.output = chosen.output or REPOSITORY / "benches/results" / report.machine_folder()
    chosen.output.mkdir(parents=True, exist_ok=True)
    table = chosen.output / "peers.csv"
    if not chosen.only_plot:
        import measure

        rows = []
        for more in measure.rows(chosen):
            rows += more
            report.write_rows(table, rows)
    rows = report.read_rows(table)
    report.write(chosen.output, rows, chosen.targets)
    if chosen.readme:
        report.write_readme(REPOSITORY / "README.md", chosen.output, rows)


if __name__ == "__main__":
    main()
