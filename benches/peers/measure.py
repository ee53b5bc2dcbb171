"""The rounds: all programs at all tolerances, in turns, and the errors of what they found."""

import datetime
import os
import platform
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import heyoka_
import numba_
import polhode_
import report
import scipy_
import truth
from problems import PROBLEMS, attitude_errors

ASKED = [10.0**-digits for digits in range(2, 14)]
# Looser and tighter than the errors of the table, so that there are points on both sides of each.
TOLERANCES = {
    "heyoka": [10.0**-digits for digits in range(2, 17)],
    "numba": [10.0**-digits for digits in range(2, 17)],
    "SciPy": [10.0**-digits for digits in range(3, 16, 2)],
    "taylor": [10.0**-digits for digits in range(3, 15)] + [3e-15],
    "rk8": [10.0**-digits for digits in range(3, 15)] + [3e-15],
}


@dataclass
class Case:
    """A program at a tolerance on an ensemble, and what the rounds found."""

    program: str
    setting: str
    solver: object
    bodies: dict | None
    count: int
    asked: float | None = None
    wall: list = field(default_factory=list)
    cpu: list = field(default_factory=list)
    states: np.ndarray | None = None
    details: dict = field(default_factory=dict)
    note: str = ""

    def run(self):
        if self.note:
            return
        clock = time.process_time()
        try:
            if self.bodies is None:
                seconds, self.states, details = self.solver()
                # The process's share stands for that of the phases charged.
                share = details["cpu_share"]
                if not self.wall or seconds < min(self.wall):
                    self.details = details
            else:
                seconds, self.states = self.solver(self.bodies)
                share = (time.process_time() - clock) / seconds / self.solver_threads
        except (polhode_.Refused, RuntimeError) as error:
            self.note = str(error)
            return
        self.wall.append(seconds)
        self.cpu.append(seconds * min(1.0, share))

    @property
    def solver_threads(self):
        return getattr(self.solver, "threads", 1)


def rows(chosen):
    """Rows of the table of results, as dictionaries; a list for each problem as it is done."""
    described = description(chosen)
    for name in chosen.problems or PROBLEMS:
        if name not in PROBLEMS:
            sys.exit(f"--problems: {name} is none of {', '.join(PROBLEMS)}")
    with tempfile.TemporaryDirectory() as folder:
        for name in chosen.problems or PROBLEMS:
            problem = PROBLEMS[name]
            sample = {column: values[: chosen.sample] for column, values in problem.bodies(chosen.sample).items()}
            states, difference = truth.checked(problem, sample, chosen.sample)
            choice = heyoka_.chosen(problem, sample) if "heyoka" in chosen.programs else None
            result = []
            say(f"{name}: truth differs from another integration by {difference:.1e} rad at most; heyoka: {choice}")
            for count, rounds in zip(chosen.bodies, chosen.rounds):
                cases = prepared(chosen, problem, count, choice, Path(folder), scipy=count == min(chosen.bodies))
                for turn in range(rounds):
                    clock = time.perf_counter()
                    for case in cases:
                        case.run()
                    say(f"{name}, {count} bodies, round {turn + 1} of {rounds}: {time.perf_counter() - clock:.0f} s")
                common = described | {
                    "problem": name,
                    "span_s": problem.span,
                    "bodies": count,
                    "rounds": rounds,
                    "sample": chosen.sample,
                    "truth_check_rad": f"{difference:.1e}",
                    "load": f"{os.getloadavg()[0]:.2f}",
                }
                result += [common | row(problem, case, states, chosen, choice) for case in cases]
            yield result


def prepared(chosen, problem, count, choice, folder, scipy):
    """The cases of a problem and a size; those of one decade stand beside each other."""
    bodies = problem.bodies(count)
    first = {
        limit: {column: values[:limit] for column, values in bodies.items()}
        for limit in (chosen.sample, min(chosen.subset, count))
    }
    polhode_.write_table(folder / "bodies.csv", bodies)
    command = (str(chosen.polhode.resolve()), folder, chosen.threads)
    cases = []
    if "polhode" in chosen.programs:
        for asked in ASKED:
            solver = polhode_.Solver(problem, f"attitude = {asked:.0e}", *command, chosen.limit)
            cases.append(Case("polhode", f"asked {asked:.0e}", solver, None, count, asked))
    for method in ("taylor", "rk8"):
        if method in chosen.programs and count <= chosen.pinned_up_to:
            for tolerance in TOLERANCES[method]:
                accuracy = f'method = "{method}"\ntolerance = {tolerance:.0e}'
                solver = polhode_.Solver(problem, accuracy, *command, chosen.limit)
                cases.append(Case(f"polhode {method}", f"tolerance {tolerance:.0e}", solver, None, count))
    for program, module in (("heyoka", heyoka_), ("numba", numba_), ("SciPy", scipy_)):
        if program not in chosen.programs or (program == "SciPy" and not scipy):
            continue
        part = {"heyoka": bodies, "numba": first[min(chosen.subset, count)], "SciPy": first[chosen.sample]}[program]
        for tolerance in TOLERANCES[program]:
            extra = (choice,) if program == "heyoka" else ()
            solver = module.Solver(problem, tolerance, *extra, threads=chosen.threads)
            cases.append(Case(program, f"tolerance {tolerance:.0e}", solver, part, len(part["inertia"])))
    return sorted(cases, key=lambda case: -float(case.setting.split()[1]))


def row(problem, case, states, chosen, choice):
    """What the rounds say of a case."""
    details = {name: f"{value:.6g}" if isinstance(value, float) else value for name, value in case.details.items()}
    if case.program == "heyoka":
        details["method"] = " ".join(f"{name}={value}" for name, value in choice.items())
    version = {"heyoka": heyoka_.VERSION, "numba": numba_.VERSION, "SciPy": scipy_.VERSION}.get(case.program)
    result = {
        "program": case.program,
        "program_version": version or polhode_.version(str(chosen.polhode)),
        "setting": case.setting,
        "asked_rad": "" if case.asked is None else f"{case.asked:.0e}",
        "bodies_run": case.count,
        "compile_seconds": f"{case.solver.compile_seconds:.3g}",
        "note": case.note,
    }
    if case.wall and not case.note:
        seconds = case.wall if chosen.clock == "wall" else case.cpu
        errors = attitude_errors(case.states[:, : states.shape[1]], states)
        result |= {
            "seconds_min": f"{min(seconds):.6g}",
            "seconds_median": f"{np.median(seconds):.6g}",
            "cpu_share": f"{np.median(np.array(case.cpu) / np.array(case.wall)):.3f}",
            "body_seconds_per_second": f"{case.count * problem.span / min(seconds):.6g}",
            "attitude_rad_median": f"{np.median(errors):.3e}",
            "attitude_rad_p99": f"{np.quantile(errors, 0.99):.3e}",
            "attitude_rad_max": f"{np.max(errors):.3e}",
        }
    return details | result


def description(chosen):
    commit = chosen.commit
    if commit is None:
        command = ["git", "-C", str(Path(__file__).parent), "rev-parse", "HEAD"]
        commit = subprocess.run(command, capture_output=True, text=True).stdout.strip() or "unknown"
    now = datetime.datetime.now(datetime.timezone.utc)
    return {
        "date": now.strftime("%Y-%m-%dT%H:%M:%SZ"),
        "commit": commit,
        "platform": f"{platform.system().lower()} {platform.machine()}",
        "cpu": report.processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "threads": chosen.threads,
        "clock": chosen.clock,
        "machine_note": chosen.note,
    }


def say(text):
    print(text, file=sys.stderr, flush=True)
