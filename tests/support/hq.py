"""HyperQueue by its Python package alone, which has server, workers and client, but not the command `hq`: as much of that command as
tests/launchers.sh and examples/launchers/hyperqueue.sh use, so that the server, its workers and their environment are the real ones."""

import argparse
import os
import pathlib
import sys
import time

from hyperqueue import Client, Job
from hyperqueue.cluster import LocalCluster, WorkerConfig
from hyperqueue.ffi.protocol import ResourceRequest

folder = pathlib.Path(os.environ["HQ_SERVER_DIR"])


def indices(text):
    """Of an array such as 3,7-9."""
    for part in text.split(","):
        first, _, last = part.partition("-")
        yield from range(int(first), int(last or first) + 1)


def serve(cpus):
    folder.mkdir(exist_ok=True)
    with LocalCluster(str(folder), WorkerConfig(cores=cpus)):
        (folder / "ready").touch()
        while not (folder / "stop").exists():
            time.sleep(0.1)


def submit(words):
    parser = argparse.ArgumentParser()
    parser.add_argument("--wait", action="store_true")
    parser.add_argument("--array", type=indices, required=True)
    parser.add_argument("--cpus", type=int, default=1)
    parser.add_argument("--env", action="append", default=[])
    parser.add_argument("command", nargs=argparse.REMAINDER)
    options = parser.parse_args(words)
    # As the command does, tasks get the environment of whoever submits them.
    job = Job(default_workdir=os.getcwd(), max_fails=None, default_env=dict(PATH=os.environ["PATH"]))
    for index in options.array:
        env = dict(entry.split("=", 1) for entry in options.env)
        task = job.program(options.command, env=env, resources=ResourceRequest(cpus=options.cpus))
        task.task_id = index
    client = Client(folder)
    client.wait_for_jobs([client.submit(job)])


match sys.argv[1:]:
    case ["server", "start"]:
        serve(2)
    case ["server", "info"]:
        sys.exit(not (folder / "ready").exists())
    case ["server", "stop"]:
        (folder / "stop").touch()
    case ["worker", "start", *_]:
        pass
    case ["submit", *words]:
        submit(words)
    case words:
        sys.exit(f"hq: {words}: not among what the tests use")
