"""polhode: the command, run once a measurement, as a user runs it.

Bodies are written to a table and a study asks for an error, or pins a method and its tolerance. The command writes
the final states and report.json, whose wall times by phase are used. Charged: the plan, set-up, integration, reading
back and the recomputed sample behind its error estimate. Not charged: reading the table, formatting and writing
files, which the peers do not do either; nor, on a GPU, opening the device and compiling for it, which stands beside
the peers' compile times.
"""

import json
import os
import resource
import signal
import subprocess
import time

import numpy as np

NAME = "polhode"

COLUMNS = {
    "inertia": ("ixx", "iyy", "izz"),
    "orientation": ("qx", "qy", "qz", "qw"),
    "angular_velocity": ("wx", "wy", "wz"),
    "torque": ("torque_x", "torque_y", "torque_z"),
    "drag": ("drag",),
    "centre": ("centre_x", "centre_y", "centre_z"),
    "dipole": ("dipole_x", "dipole_y", "dipole_z"),
}


class Refused(Exception):
    """The command says that it cannot do what is asked, or takes too long."""


def version(command):
    return subprocess.run([command, "--version"], capture_output=True, text=True, check=True).stdout.split()[-1]


def write_table(path, bodies):
    names = [name for column in bodies for name in COLUMNS[column]]
    table = np.concatenate(list(bodies.values()), axis=1)
    with open(path, "w") as file:
        file.write(",".join(names) + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in table.tolist())


class Solver:
    """A study of a problem; `accuracy` is the text of its section.

    A run that takes longer than `limit` seconds is stopped. `engine` is the word of the command, with its options.
    """

    compile_seconds = 0.0

    def __init__(self, problem, accuracy, command, folder, threads=1, limit=None, engine=("cpu",)):
        self.command, self.folder, self.threads = command, folder, threads
        self.limit, self.engine = limit, engine
        self.text = (
            f'title = "{problem.title}"\n\n[bodies]\nfile = "bodies.csv"\n\n{problem.torques}\n'
            f'[time]\nend = {problem.span}\n\n[accuracy]\n{accuracy}\n\n[output]\nformat = "npz"\n'
        )

    def run(self):
        """The report, wall seconds and processor seconds of the process."""
        study, out = self.folder / "study.toml", self.folder / "out"
        study.write_text(self.text)
        command = [self.command, "run", study, "--engine", *self.engine, "--out", out, "--force", "--quiet"]
        before, clock = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        environment = os.environ | {"RAYON_NUM_THREADS": str(self.threads)}
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
        try:
            output, errors = process.communicate(timeout=self.limit)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            process.communicate()
            raise Refused(f"stopped after {self.limit:g} s") from None
        wall, after = time.perf_counter() - clock, resource.getrusage(resource.RUSAGE_CHILDREN)
        if process.returncode != 0:
            message = (errors.strip() or output.strip() or f"exit status {process.returncode}").splitlines()[0]
            raise Refused(message.replace(f"{self.folder}{os.sep}", ""))
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return json.loads((out / "report.json").read_text()), wall, cpu

    def __call__(self):
        """Seconds charged, orientations at the end (four rows) and what the report says."""
        report, wall, cpu = self.run()
        self.report = report
        phases = report["wall_time"]
        charged = phases["total"] - phases["study"] - phases["format"] - phases["disk"]
        if self.engine[0] != "cpu":
            charged -= phases["start"]
        with np.load(self.folder / "out" / "final.npz") as final:
            states = np.stack([final[name] for name in COLUMNS["orientation"]])
            states = states[:, np.argsort(final["body"])]
        details = {
            "process_seconds": wall,
            "cpu_share": cpu / wall / self.threads,
            "plan_seconds": phases["plan"],
            "compute_seconds": phases["compute"],
            "sample_seconds": phases["recomputed_sample"],
            "method": report["plan"]["method"],
            "precision": report["plan"]["precision"],
            "met": {True: "yes", False: "no", None: ""}[report["accuracy"]["met"]],
        }
        return charged, states, details
