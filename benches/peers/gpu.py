"""Times polhode on a GPU beside diffrax, MuJoCo MJX and kernels of numba-cuda and CUDA C++ on the same GPU.

    python3 benches/peers/gpu.py --polhode target/release/polhode --truth truth.npz --output peers-gpu.out

Same bodies and equations as run.py, errors against the same truth. The README beside this file says what is charged.
A program that is not installed is named and left out; its Python packages are not in requirements.txt.
"""

import argparse
import datetime
import glob
import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parent.parent
sys.path.insert(0, str(HERE))

import numpy as np

import gpu_worker
import polhode_
import report
from problems import PROBLEMS, attitude_errors

# The order, and parts of the time: a program that needs less leaves the rest to those after it.
SHARES = {"cuda-c": 15, "polhode": 65, "diffrax": 40, "mjx-f32": 15, "numba-cuda": 20, "mjx-f64": 12}
PACKAGES = {
    "numba-cuda": ("numba", "numba_cuda"),
    "cuda-c": ("cupy",),
    "diffrax": ("jax", "diffrax"),
    "mjx-f32": ("jax", "mujoco", "mujoco.mjx", "trimesh"),
    "mjx-f64": ("jax", "mujoco", "mujoco.mjx", "trimesh"),
}
COLUMNS = (
    "date commit machine driver cpu cores python program program_version problem span_s bodies device precision method "
    "target_rad setting repeats seconds seconds_min seconds_max device_seconds body_seconds_per_second "
    "attitude_rad_median attitude_rad_p99 sample truth truth_check_rad compile_seconds start_seconds process_seconds "
    "plan_seconds sample_seconds note"
).split()
BY_POLHODE = "polhode, cpu, taylor at 1e-14"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    default = ["free", "heavy-top", "gradient", "orbit"]
    add(
        "--problems",
        nargs="+",
        choices=PROBLEMS,
        default=default,
        metavar="NAME",
        help=f"of {', '.join(PROBLEMS)} [default: {' '.join(default)}]",
    )
    add(
        "--bodies",
        nargs="+",
        type=int,
        default=[131_072, 1_048_576],
        help="sizes of the ensemble; settings are sought on the smallest [default: 131072 1048576]",
    )
    add(
        "--programs",
        nargs="+",
        choices=gpu_worker.PROGRAMS,
        default=gpu_worker.PROGRAMS,
        metavar="NAME",
        help=f"of {', '.join(gpu_worker.PROGRAMS)} [default: all]",
    )
    add("--targets", nargs="+", type=float, default=[1e-3, 1e-6, 1e-9], metavar="RAD", help="[default: 1e-3 1e-6 1e-9]")
    add("--repeats", type=int, default=2, help="runs after the one that compiles; the median counts [default: 2]")
    add("--limit", type=float, default=150, metavar="SECONDS", help="time for everything [default: 150]")
    add(
        "--case-limit",
        type=float,
        default=10,
        metavar="SECONDS",
        help="a run expected to take longer is left out; polhode's process has three times as long [default: 10]",
    )
    add("--sample", type=int, default=1024, help="bodies whose errors are measured [default: 1024]")
    add("--truth", type=Path, metavar="FILE", help="the truth (.npz), made if there is no such file")
    add("--only-truth", action="store_true", help="make the truth of the problems, and no more")
    add("--polhode", type=Path, default=REPOSITORY / "target/release/polhode", metavar="PATH", help="the command")
    add(
        "--polhode-engine",
        default="gpu",
        metavar="WORDS",
        help='what stands after its --engine, such as "cpu" or "gpu --adapter 1" [default: gpu]',
    )
    add("--commit", help="the commit that polhode was built from [default: the repository's]")
    add("--output", type=Path, default=Path("peers-gpu.out"), metavar="DIR", help="[default: peers-gpu.out]")
    add("--only-table", action="store_true", help="make the tables again from gpu-peers.csv")
    # Of the process of one program.
    add("--work", help=argparse.SUPPRESS)
    add("--until", type=float, help=argparse.SUPPRESS)
    add("--scratch", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    chosen.bodies = sorted(set(chosen.bodies))
    if chosen.bodies[0] < chosen.sample:
        parser.error(f"--bodies: at least the {chosen.sample} of --sample")
    if chosen.repeats < 1:
        parser.error("--repeats: at least 1")
    return chosen


# Truth


def truth_file(chosen):
    """Orientations at the end of the sample in a file, a problem each, with what made them.

    Taken from the file if it holds the problems for the same bodies, else made: by heyoka in 80-bit arithmetic where it
    is installed, else by polhode's Taylor series on the CPU.
    """
    path = chosen.truth
    stored = {}
    if path.is_file():
        with np.load(path) as file:
            stored = {name: file[name] for name in file.files}
    for name in chosen.problems:
        problem = PROBLEMS[name]
        bodies = problem.bodies(chosen.sample)
        start = np.concatenate(list(bodies.values()), axis=1)
        if name in stored and stored[name].shape[1] >= chosen.sample:
            # Another version of NumPy may round otherwise, but must not draw otherwise.
            if not np.allclose(stored[f"{name} start"], start[:8], rtol=1e-12, atol=0):
                raise SystemExit(f"{path}: {name} was made for other bodies")
            stored[name] = stored[name][:, : chosen.sample]
            continue
        clock = time.perf_counter()
        states, made_by = truth_of(problem, bodies, chosen)
        difference = truth_check(problem, bodies, states)
        stored |= {
            name: np.asarray(states, float),
            f"{name} start": start[:8],
            f"{name} by": np.array(made_by),
            f"{name} check": np.array(difference),
        }
        say(f"truth of {name}: {made_by}, {difference:.1e} rad from SciPy, {time.perf_counter() - clock:.0f} s")
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, **stored)
    return {name: (str(stored[f"{name} by"]), float(stored[f"{name} check"])) for name in chosen.problems}


def truth_of(problem, bodies, chosen):
    try:
        import heyoka

        import truth

        return truth.attitudes(problem, bodies, chosen.sample), f"heyoka {heyoka.__version__}, 80 bits"
    except ImportError:
        pass
    with tempfile.TemporaryDirectory() as folder:
        polhode_.write_table(Path(folder) / "bodies.csv", bodies)
        accuracy = 'method = "taylor"\ntolerance = 1e-14'
        solver = polhode_.Solver(
            problem, accuracy, str(chosen.polhode.resolve()), Path(folder), len(os.sched_getaffinity(0))
        )
        return solver()[1], BY_POLHODE


def truth_check(problem, bodies, states, few=4):
    """The greatest angle to an integration of other equations by SciPy."""
    try:
        import truth

        return float(np.max(attitude_errors(truth.matrices(problem, bodies, few), states[:, :few])))
    except ImportError:
        return float("nan")


# The programs, each in a process of its own


def missing(program):
    """The packages of a program that this Python cannot find."""
    from importlib.util import find_spec

    absent = []
    for name in PACKAGES.get(program, ()):
        try:
            if find_spec(name) is None:
                absent.append(name)
        except Exception:  # A package that is there and cannot be loaded.
            absent.append(name)
    return absent


def environment(program):
    result = os.environ | {"PYTHONUNBUFFERED": "1", "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}
    if program == "numba-cuda" and "CUDA_HOME" not in result:
        # numba-cuda looks for NVVM there.
        compilers = [shutil.which("nvcc") or ""] + sorted(glob.glob("/usr/local/cuda*/bin/nvcc"))
        found = [Path(compiler).resolve().parent.parent for compiler in compilers if compiler]
        if found:
            result["CUDA_HOME"] = str(found[0])
    return result


def run_program(program, chosen, until, scratch, received):
    """The rows of a program, given to `received` one by one. It is stopped when its time is over."""
    command = [sys.executable, str(HERE / "gpu.py"), "--work", program, "--until", str(until), "--scratch", scratch]
    for name in ("problems", "bodies", "targets"):
        command += [f"--{name}", *map(str, getattr(chosen, name))]
    for name in ("repeats", "case_limit", "sample", "truth", "polhode", "polhode_engine"):
        command += [f"--{name.replace('_', '-')}", str(getattr(chosen, name))]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=None, text=True, env=environment(program), start_new_session=True
    )

    def stop():
        say(f"{program}: stopped, its time is over")
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass

    # It stops by itself between runs; this is for one that hangs.
    timer = threading.Timer(max(1.0, until - time.time()) + chosen.grace, stop)
    timer.start()
    try:
        for line in process.stdout:
            if line.startswith(gpu_worker.MARK):
                received(json.loads(line.removeprefix(gpu_worker.MARK)))
            else:
                say(line.rstrip())
        status = process.wait()
    finally:
        timer.cancel()
        if process.poll() is None:
            stop()
    if status != 0:
        say(f"{program}: ended with status {status}")


def measured_rows(chosen, truth):
    begun = time.time()
    end = chosen.begun + chosen.limit
    programs = []
    for program in chosen.programs:
        absent = missing(program)
        if absent:
            say(f"{program}: left out, not installed: {', '.join(absent)}")
        elif program == "polhode" and not chosen.polhode.is_file():
            say(f"polhode: left out, no such file: {chosen.polhode}")
        else:
            programs.append(program)
    programs.sort(key=list(SHARES).index)
    common = description(chosen)
    rows = []

    def received(row):
        made_by, check = truth[row["problem"]]
        rows.append(common | row | {"truth": made_by, "truth_check_rad": f"{check:.1e}"})
        report.write_rows(chosen.output / "gpu-peers.csv", rows, COLUMNS)
        names = ("setting", "precision", "seconds", "device_seconds", "attitude_rad_p99", "compile_seconds", "note")
        said = ", ".join(f"{name} {row[name]}" for name in names if row.get(name))
        say(f"[{time.time() - chosen.begun:5.1f} s] {row['program']} {row['problem']} {row['bodies']}: {said}")

    with tempfile.TemporaryDirectory() as folder:
        for index, program in enumerate(programs):
            left = end - time.time()
            if left < 3:
                say(f"{program}: left out, no time left")
                continue
            part = SHARES[program] / sum(SHARES[other] for other in programs[index:])
            scratch = Path(folder) / program
            scratch.mkdir()
            clock = time.time()
            # The last seconds are for the end of a run under way.
            chosen.grace = min(5.0, 0.2 * left)
            try:
                until = time.time() + part * (left - chosen.grace)
                run_program(program, chosen, until, str(scratch), received)
            except Exception as error:
                say(f"{program}: {type(error).__name__}: {error}")
            shutil.rmtree(scratch, ignore_errors=True)
            say(f"{program}: {time.time() - clock:.1f} s")
    say(f"all programs: {time.time() - begun:.1f} s")
    return rows


def description(chosen):
    commit = chosen.commit
    if commit is None:
        command = ["git", "-C", str(HERE), "rev-parse", "HEAD"]
        try:
            commit = subprocess.run(command, capture_output=True, text=True).stdout.strip() or "unknown"
        except OSError:
            commit = "unknown"
    name, driver = graphics()
    now = datetime.datetime.now(datetime.timezone.utc)
    return {
        "date": now.strftime("%Y-%m-%dT%H:%M:%SZ"),
        "commit": commit,
        "machine": name,
        "driver": driver,
        "cpu": report.processor(),
        "cores": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
    }


def graphics():
    """Name and driver of the first NVIDIA GPU."""
    command = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    try:
        lines = subprocess.run(command, capture_output=True, text=True, timeout=20).stdout.splitlines()
        name, driver = lines[0].rsplit(", ", 1)
        return name, driver
    except (OSError, IndexError, ValueError, subprocess.TimeoutExpired):
        return "no NVIDIA GPU", ""


# Tables


def points(rows, problem, bodies, program, seconds):
    """(error, body·s/s) of a program, by the seconds of a column."""
    return [
        (float(row["attitude_rad_p99"]), int(row["bodies"]) * float(row["span_s"]) / float(row[seconds]))
        for row in rows
        if (row["problem"], int(row["bodies"]), row["program"]) == (problem, bodies, program)
        and row["attitude_rad_p99"]
        and float(row[seconds]) > 0
    ]


def table(rows, problem, bodies, seconds, targets):
    shown = [program for program in gpu_worker.PROGRAMS if points(rows, problem, bodies, program, seconds)]
    others = [program for program in shown if program != "polhode"]
    lines = [
        "| error (rad) | " + " | ".join(shown) + " | polhode / best other | best other |",
        "| --- |" + " --- |" * (len(shown) + 2),
    ]
    for error in targets:
        speeds = {p: report.speed_at(points(rows, problem, bodies, p, seconds), error) for p in shown}
        reached = [program for program in others if speeds[program]]
        best = max(reached, key=speeds.get) if reached else None
        cells = [report.number(speeds[program]) for program in shown]
        cells += [report.ratio(speeds.get("polhode"), speeds.get(best)), best or "–"]
        lines.append(f"| {report.power(error)} | " + " | ".join(cells) + " |")
    return lines


def starts(rows, problem, bodies):
    """Compiling and starting, which are not charged."""
    texts = []
    for program in gpu_worker.PROGRAMS:
        here = [
            row
            for row in rows
            if (row["problem"], int(row["bodies"]), row["program"]) == (problem, bodies, program) and row["seconds"]
        ]
        compiled = sorted(float(row["compile_seconds"]) for row in here if row["compile_seconds"])
        started = sorted(float(row["start_seconds"]) for row in here if row["start_seconds"])
        if program == "polhode" and started:
            cold = f"{compiled[-1]:.2g} s at most on an empty cache, " if compiled else ""
            texts.append(f"polhode {cold}{started[0]:.2g} to {started[-1]:.2g} s later")
        elif compiled:
            texts.append(f"{program} {compiled[-1]:.2g} s")
    return "Starting and compiling, not charged: " + "; ".join(texts) + "." if texts else ""


def methods(rows, problem, bodies):
    """What polhode's plan chose, and the error that came out."""
    texts = [
        f"{row['target_rad']}: {row['method']}, {row['precision']}, {report.number(float(row['attitude_rad_p99']))}"
        if row["attitude_rad_p99"]
        else f"{row['target_rad']}: {row['note']}"
        for row in rows
        if (row["problem"], int(row["bodies"]), row["program"]) == (problem, bodies, "polhode")
    ]
    return "polhode, asked and found: " + "; ".join(texts) + "." if texts else ""


def left_out(rows, problem, bodies):
    texts = [
        f"{row['program']} at {row['target_rad']} ({row['note'].removeprefix('left out: ')})"
        for row in rows
        if (row["problem"], int(row["bodies"])) == (problem, bodies)
        and row["program"] != "polhode"
        and not row["seconds"]
        and row["note"]
    ]
    return "Not reached: " + "; ".join(texts) + "." if texts else ""


def write_tables(path, rows, targets):
    row = rows[0]
    versions = {entry["program"]: entry["program_version"] for entry in rows if entry["program_version"]}
    devices = sorted({f"{entry['program']}: {entry['device']}" for entry in rows if entry["device"]})
    lines = ["# polhode and its peers on a GPU", ""]
    lines += [
        f"{row['machine']}, driver {row['driver'] or '–'}, {row['cores']} cores of {row['cpu']}, {row['date'][:10]}, "
        f"commit {row['commit'][:7]}, Python {row['python']}; "
        + ", ".join(f"{name} {version}" for name, version in versions.items())
        + ". "
        + f"Devices as the programs name them: {'; '.join(devices)}.",
        "",
        "Body·s/s at the 99th percentile of the attitude error in the first column, from the measured points by lines",
        "in logarithms; the second table has computing on the device alone, without transfers, plans and the host's",
        "part. –: not reached. `benches/peers/README.md` says what is charged.",
        "",
    ]
    present = {entry["problem"] for entry in rows}
    for name in (name for name in PROBLEMS if name in present):
        for bodies in report.sizes(rows):
            problem = PROBLEMS[name]
            if not any(points(rows, name, bodies, program, "seconds") for program in gpu_worker.PROGRAMS):
                continue
            lines += [f"## {problem.title}, {problem.span:g} s, {bodies:,} bodies", ""]
            lines += ["Host to host:", "", *table(rows, name, bodies, "seconds", targets), ""]
            lines += ["Device alone:", "", *table(rows, name, bodies, "device_seconds", targets), ""]
            for text in (starts, methods, left_out):
                if text(rows, name, bodies):
                    lines += [text(rows, name, bodies), ""]
    path.write_text("\n".join(lines).rstrip() + "\n")


def say(text):
    print(text, flush=True)


def main():
    chosen = arguments()
    chosen.begun = time.time()
    if chosen.work:
        gpu_worker.work(chosen.work, chosen)
        return
    chosen.output.mkdir(parents=True, exist_ok=True)
    table_path = chosen.output / "gpu-peers.csv"
    if not chosen.only_table:
        chosen.truth = chosen.truth or chosen.output / "truth.npz"
        truth = truth_file(chosen)
        if chosen.only_truth:
            return
        if not measured_rows(chosen, truth):
            raise SystemExit("no row was measured")
    rows = report.read_rows(table_path)
    write_tables(chosen.output / "gpu-peers.md", rows, sorted(chosen.targets, reverse=True))
    say((chosen.output / "gpu-peers.md").read_text())


if __name__ == "__main__":
    main()
