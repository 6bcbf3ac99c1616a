"""Starts programs of several ranks, by mpirun or by torchrun's variables."""

import atexit
import contextlib
import functools
import importlib.util
import json
import os
import random
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import forks
import pytest

FOLDER = Path(__file__).parent
MPI = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    # Ranks of one host need no network.
    "OMPI_MCA_btl": "self,vader",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
}


# Ways to send between GPUs, see `checking.joined`.
ON_GPUS = ("nccl", "torch-nccl", "gloo")


def missing(engine):
    """Name of what an engine needs and is absent, or None."""
    if engine == "none":
        return None
    if engine in ("torch", "torch-nccl", "gloo"):
        return None if importlib.util.find_spec("torch") else "torch"
    if importlib.util.find_spec("mpi4py") is None:
        return "mpi4py"
    return None if shutil.which("mpirun") else "mpirun"


def need(engine):
    """Skips the test where a part of the engine is absent."""
    if name := missing(engine):
        pytest.skip(f"{name} is not installed")


def environment(**more):
    """Variables of a rank: two threads in all are enough."""
    # Ranks on the CPU: a host may have fewer GPUs than ranks.
    about = {"WARP_NUM_THREADS": "1", "PYTHONPATH": path(), "CUDA_VISIBLE_DEVICES": ""}
    found = {**os.environ, **about, **more}
    return {name: value for name, value in found.items() if value is not None}


def path():
    return os.pathsep.join([str(FOLDER), os.environ.get("PYTHONPATH", "")])


def free_port():
    """A port below those that the system gives to any program before the ranks take it."""
    for port in random.sample(range(20000, 32000), 100):
        with socket.socket() as one, contextlib.suppress(OSError):
            one.bind(("", port))
            return str(port)
    raise OSError("no free port")


@functools.cache
def _forks():
    found = forks.Forks()
    atexit.register(found.close)
    return found


def start(engine, size, program, *arguments, file, **variables):
    """Starts the ranks, with output into a file; gives the processes.

    Ranks of gloo are forks of a process that has PyTorch. Engines of `ON_GPUS` have a GPU for each
    rank, started by the variables of torchrun.
    """
    command = [sys.executable, str(program), *map(str, arguments)]
    pipes = {"stdout": file, "stderr": subprocess.STDOUT}
    if engine == "none":
        return [subprocess.Popen(command, env=environment(**variables), **pipes)]
    if engine == "mpi":
        mpirun = ["mpirun", "-n", str(size), "--oversubscribe", "--allow-run-as-root"]
        return [subprocess.Popen([*mpirun, *command], env=environment(**MPI, **variables), **pipes)]
    about = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": free_port(), "WORLD_SIZE": str(size)}
    about |= {"LOCAL_WORLD_SIZE": str(size)}
    if engine in ON_GPUS:
        command.append(f"--way={engine}")
        about["NCCL_DEBUG"] = os.environ.get("NCCL_DEBUG", "WARN")
        # All GPUs are shown, so that ranks have to choose their own.
        about["CUDA_VISIBLE_DEVICES"] = os.environ.get("CUDA_VISIBLE_DEVICES")
    places = [{"RANK": str(rank), "LOCAL_RANK": str(rank)} for rank in range(size)]
    environments = [environment(**about, **place, **variables) for place in places]
    if engine in ("torch", "gloo"):
        return [_forks().start(command, one, file) for one in environments]
    return [subprocess.Popen(command, env=one, **pipes) for one in environments]


def run(engine, size, program, *arguments, limit=60, **variables):
    """Runs a program on ranks; gives exit codes and all output.

    A rank that fails ends the others, as torchrun does it.
    """
    with tempfile.TemporaryFile("w+") as file:
        processes = start(engine, size, program, *arguments, file=file, **variables)
        end = time.monotonic() + limit
        try:
            while time.monotonic() < end:
                codes = [one.poll() for one in processes]
                if None not in codes:
                    break
                if any(codes):
                    # The others may still say who is gone.
                    end = min(end, time.monotonic() + 3)
                time.sleep(0.02)
        finally:
            for one in processes:
                if one.poll() is None:
                    one.kill()
                    one.wait()
        file.seek(0)
        return [one.returncode for one in processes], file.read()


def seconds_since_failure(output):
    """Seconds since `failing.py` failed; its start takes long on a busy machine."""
    began = re.search(r"fails at ([\d.]+)", output)
    return time.time() - float(began[1]) if began else float("inf")


@functools.cache
def results(engine, size, program, *arguments, limit=280):
    """The facts that a program of checks printed as JSON, by name of the check.

    A check that ends the ranks is a fact, too, `{"error": ...}` with the end of their output; the
    ranks are started again for those behind it while there is time.
    """
    end = time.monotonic() + limit
    facts: dict = {}
    while True:
        skip = [f"--skip={','.join(facts)}"] if facts else []
        left = end - time.monotonic()
        codes, output = run(engine, size, FOLDER / program, *arguments, *skip, limit=max(left, 1))
        begun, count = None, len(facts)
        for line in output.splitlines():
            if line.startswith("{"):
                one = json.loads(line)
                if "begins" in one:
                    begun = one["begins"]
                else:
                    begun = None
                    facts.update(one)
        if not any(codes):
            return facts
        text = "\n".join(one for one in output.splitlines() if not one.startswith("{"))[-3000:]
        if begun is None and not (skip or facts):
            return Failed(f"the ranks end with {codes}: {text}")
        if begun is not None:
            facts[begun] = {"error": f"the ranks end with {codes}: {text}"}
        if len(facts) == count or time.monotonic() > end - 10:
            return facts


class Failed(dict):
    """The facts of ranks that did not start: each is the same error."""

    def __init__(self, text):
        super().__init__()
        self.text = text

    def __contains__(self, name):
        return True

    def __missing__(self, name):
        return {"error": self.text}
