"""One program of gpu.py in a process of its own: a fault, a hang or a lack of memory ends this program alone.

Rows go to the standard output, a line of JSON each, as they are measured.
"""

import importlib
import json
import os
import time
import traceback
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import polhode_
from problems import PROBLEMS, attitude_errors

# Name in the table: module and what `use` of it is called with.
MODULES = {
    "numba-cuda": ("numba_cuda_", None),
    "cuda-c": ("cuda_c_", None),
    "diffrax": ("diffrax_", None),
    "mjx-f32": ("mjx_", "f32"),
    "mjx-f64": ("mjx_", "f64"),
}
PROGRAMS = ("polhode", *MODULES)
MARK = "ROW "
# A setting is sought until the error lies between these parts of the target.
CLOSE, AIM = 0.3, 0.6
TRIES = 5


class Late(Exception):
    """The time of this program is over, or a case would take too long."""


class Work:
    """What all cases of a program share: options, truth, deadline and the rows."""

    def __init__(self, program, chosen, truth):
        self.program, self.chosen, self.truth = program, chosen, truth
        self.until = chosen.until

    def left(self):
        return self.until - time.time()

    def check(self, expected, limit=True):
        if limit and expected > self.chosen.case_limit:
            raise Late(f"a run would take {expected:.0f} s")
        if expected > self.left():
            raise Late("no time left")

    def row(self, problem, bodies, target, **more):
        row = {
            "program": self.program,
            "problem": problem.name,
            "span_s": problem.span,
            "bodies": bodies,
            "target_rad": f"{target:.0e}",
            "sample": self.truth[problem.name].shape[1],
        }
        print(MARK + json.dumps(row | more), flush=True)

    def errors(self, problem, q):
        truth = self.truth[problem.name]
        q = np.asarray(q)[:, : truth.shape[1]]
        # A body without a finite attitude is lost.
        return np.where(np.all(np.isfinite(q), axis=0), attitude_errors(q, truth), np.pi)

    def measured(self, problem, bodies, target, runs, errors, **more):
        """The row of repeated runs: pairs of seconds charged and seconds of computing alone."""
        seconds, device_seconds = np.array(runs).T
        median = float(np.median(seconds))
        p50, p99 = np.quantile(errors, [0.5, 0.99])
        self.row(
            problem,
            bodies,
            target,
            repeats=len(runs),
            seconds=f"{median:.6g}",
            seconds_min=f"{np.min(seconds):.6g}",
            seconds_max=f"{np.max(seconds):.6g}",
            device_seconds=f"{np.median(device_seconds):.6g}",
            body_seconds_per_second=f"{bodies * problem.span / median:.6g}",
            attitude_rad_median=f"{p50:.3e}",
            attitude_rad_p99=f"{p99:.3e}",
            **more,
        )


def work(program, chosen):
    """All cases of a program; `chosen` are the options of gpu.py."""
    with np.load(chosen.truth) as file:
        truth = {name: file[name][:, : chosen.sample] for name in chosen.problems}
    task = Work(program, chosen, truth)
    if program == "polhode":
        polhode(task)
    else:
        peer(task)


# The peers


def peer(task):
    name, argument = MODULES[task.program]
    clock = time.perf_counter()
    module = importlib.import_module(name)
    if argument:
        module.use(argument)
    device = module.device()
    print(f"{task.program}: {module.version()} on {device}, {time.perf_counter() - clock:.1f} s to load", flush=True)
    common = {
        "program_version": module.version(),
        "device": device,
        "precision": module.PRECISION,
        "method": module.METHOD,
    }
    for problem in (PROBLEMS[name] for name in task.chosen.problems):
        if hasattr(module, "solves") and not module.solves(problem):
            print(f"{task.program}: {problem.name} cannot be put to it", flush=True)
            continue
        try:
            solver, found = module.Solver(problem), {}
            for index, count in enumerate(task.chosen.bodies):
                peer_ensemble(task, module, solver, problem, count, found, common, first=index == 0)
        except Exception:
            print(f"{task.program}, {problem.name}:\n{traceback.format_exc()}", flush=True)


def peer_ensemble(task, module, solver, problem, count, found, common, first):
    """The cases of an ensemble. The smallest finds the settings and stores in `found` what they cost."""
    chosen = task.chosen
    bodies = problem.bodies(count)
    compile_seconds = None

    def run(setting):
        seconds, device_seconds, q = solver(bodies, setting)
        return (seconds, device_seconds), task.errors(problem, q)

    for target in sorted(chosen.targets, reverse=True):
        try:
            if compile_seconds is None:
                task.check(0.0 if first else cost(found, target, count))
                clock = time.perf_counter()
                run(found[target][0] if target in found else module.guess(problem, target))
                compile_seconds = time.perf_counter() - clock
            details = common | {"compile_seconds": f"{compile_seconds:.3g}"}

            def measured(setting, runs, errors):
                task.measured(problem, count, target, runs, errors, setting=module.label(setting), **details)

            if first:
                if found:
                    setting, seconds, _ = found[min(found)]
                    task.check(seconds * more_steps(module, setting, module.guess(problem, target)))
                setting, one, errors = sought(task, module, problem, target, run, measured)
                found[target] = setting, one[0], count
            elif target in found:
                setting = found[target][0]
                task.check(cost(found, target, count))
                one, errors = run(setting)
            else:
                continue
            runs = [one]
            for _ in range(chosen.repeats - 1):
                if one[0] > task.left():
                    break
                runs.append(run(setting)[0])
            measured(setting, runs, errors)
        except Late as late:
            task.row(problem, count, target, note=f"left out: {late}", **common)
        except Exception as error:
            print(f"{task.program}, {problem.name}, {count}, {target}:\n{traceback.format_exc()}", flush=True)
            task.row(problem, count, target, note=failure(error), **common)


def failure(error):
    """The kind of an error and the first line of its message."""
    lines = str(error).splitlines()
    return f"failed: {type(error).__name__}" + (f": {lines[0][:120]}" if lines else "")


def cost(found, target, count):
    """Seconds expected of a run, from those of the smaller ensemble."""
    if target not in found:
        return 0.0
    _, seconds, bodies = found[target]
    return seconds * max(1.0, count / bodies)


def more_steps(module, setting, following):
    """The ratio of steps: equal ones are the setting itself, adaptive ones of order eight follow the tolerance."""
    return (setting / following) ** (1.0 if module.EQUAL_STEPS else 0.125)


def sought(task, module, problem, target, run, measured):
    """The setting with an error a little below the target, and its run. Other tries are rows of their own."""
    setting, history = module.guess(problem, target), []
    for attempt in range(TRIES):
        one, errors = run(setting)
        error = max(float(np.quantile(errors, 0.99)), 1e-300)
        if CLOSE * target <= error <= target:
            return setting, one, errors
        history.append((setting, error, one, errors))
        if attempt and error > target and error > 0.5 * history[-2][1] and setting < 0.7 * history[-2][0]:
            measured(setting, [one], errors)
            raise Late(f"errors do not fall below {min(entry[1] for entry in history):.0e}")
        following = setting * (AIM * target / error) ** (1 / module.EXPONENT)
        if len(history) > 1 and error != history[-2][1]:
            exponent = np.log(error / history[-2][1]) / np.log(setting / history[-2][0])
            if 0.3 * module.EXPONENT < exponent < 3 * module.EXPONENT:
                following = setting * (AIM * target / error) ** (1 / exponent)
        if attempt == TRIES - 1:
            break
        measured(setting, [one], errors)
        task.check(one[0] * more_steps(module, setting, following))
        setting = following
    met = [entry for entry in history if entry[1] <= target]
    if not met:
        raise Late("no setting found")
    setting, _, one, errors = max(met, key=lambda entry: entry[1])
    return setting, one, errors


# polhode


def polhode(task):
    chosen = task.chosen
    folder = Path(chosen.scratch)
    # Its own cache, empty at first, so that the first start shows what compiling takes.
    os.environ["POLHODE_DEVICE_CACHE"] = str(folder / "cache")
    command, version = str(chosen.polhode.resolve()), polhode_.version(str(chosen.polhode))
    cold = {}
    # Small ensembles of all problems first: if time runs out, the large ones of the last problems are missing.
    for index, count in enumerate(chosen.bodies):
        for problem in (PROBLEMS[name] for name in chosen.problems):
            try:
                write_table(folder / "bodies.csv", problem.bodies(count))
                for target in sorted(chosen.targets, reverse=True):
                    polhode_case(task, problem, count, target, (command, folder), version, cold, first=index == 0)
            except Exception:
                print(f"polhode, {problem.name}:\n{traceback.format_exc()}", flush=True)


def polhode_case(task, problem, count, target, command, version, cold, first):
    chosen = task.chosen
    threads = len(os.sched_getaffinity(0))
    solver = polhode_.Solver(
        problem, f"attitude = {target:.0e}", *command, threads, engine=tuple(chosen.polhode_engine.split())
    )
    common = {"program_version": version, "setting": f"asked {target:.0e}"}
    try:
        runs, processes, starts, details, states = [], [], [], {}, None
        if first:
            task.check(0.0)
            solver.limit = polhode_limit(task)
            solver()
            cold[problem.name, target] = solver.report["wall_time"]["start"]
        for _ in range(chosen.repeats):
            try:
                task.check(processes[-1] if processes else 0.0, limit=False)
            except Late:
                if runs:
                    break
                raise
            solver.limit = polhode_limit(task)
            seconds, states, details = solver()
            phases = solver.report["wall_time"]
            runs.append((seconds, phases["compute"]))
            starts.append(phases["start"])
            processes.append(details["process_seconds"])
        engine = solver.report["engine"]
        task.measured(
            problem,
            count,
            target,
            runs,
            task.errors(problem, states),
            device=engine.get("adapter") or engine["kind"],
            precision=details["precision"],
            method=details["method"],
            # Of the first start on an empty cache; later ones read it.
            compile_seconds=f"{cold[problem.name, target]:.3g}" if (problem.name, target) in cold else "",
            start_seconds=f"{np.median(starts):.3g}",
            process_seconds=f"{np.median(processes):.3g}",
            plan_seconds=f"{details['plan_seconds']:.3g}",
            sample_seconds=f"{details['sample_seconds']:.3g}",
            **common,
        )
    except Late as late:
        task.row(problem, count, target, note=f"left out: {late}", **common)
    except polhode_.Refused as error:
        task.row(problem, count, target, note=str(error), **common)
    except Exception as error:
        print(f"polhode, {problem.name}, {count}, {target}:\n{traceback.format_exc()}", flush=True)
        task.row(problem, count, target, note=failure(error), **common)


def polhode_limit(task):
    """Seconds for its process, which also reads the table, compiles and writes."""
    return min(3 * task.chosen.case_limit, max(1.0, task.left()))


def rows_of_text(table):
    return "".join(",".join(map(repr, row)) + "\n" for row in table.tolist())


def write_table(path, bodies):
    """`polhode_.write_table` on all cores: a million bodies take it a quarter of a minute."""
    names = [name for column in bodies for name in polhode_.COLUMNS[column]]
    table = np.concatenate(list(bodies.values()), axis=1)
    cores = len(os.sched_getaffinity(0))
    parts = np.array_split(table, max(1, min(4 * cores, len(table) // 4096)))
    with open(path, "w") as file, ProcessPoolExecutor(cores, get_context("fork")) as pool:
        file.write(",".join(names) + "\n")
        file.writelines(pool.map(rows_of_text, parts))
