"""Starts programs of several ranks, by mpirun or by torchrun's variables."""

import functools
import importlib.util
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FOLDER = Path(__file__).parent
MPI = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    # Ranks of one host need no network.
    "OMPI_MCA_btl": "self,vader",
    "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
}


def missing(engine):
    """Name of what an engine needs and is absent, or None."""
    if engine == "torch":
        return None if importlib.util.find_spec("torch") else "torch"
    if importlib.util.find_spec("mpi4py") is None:
        return "mpi4py"
    return None if shutil.which("mpirun") else "mpirun"


def environment(**more):
    """Variables of a rank: two threads in all are enough."""
    # Ranks on the CPU: a host may have fewer GPUs than ranks.
    about = {"WARP_NUM_THREADS": "1", "PYTHONPATH": path(), "CUDA_VISIBLE_DEVICES": ""}
    return {**os.environ, **about, **more}


def path():
    return os.pathsep.join([str(FOLDER), os.environ.get("PYTHONPATH", "")])


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return str(one.getsockname()[1])


def start(engine, size, program, *arguments, **options):
    """Starts the ranks; gives the processes whose output is to be read.

    Engine `nccl` has a GPU for each rank, started by the variables of torchrun.
    """
    command = [sys.executable, str(program), *map(str, arguments)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, **options}
    if engine == "none":
        return [subprocess.Popen(command, env=environment(), **pipes)]
    if engine == "mpi":
        mpirun = ["mpirun", "-n", str(size), "--oversubscribe", "--allow-run-as-root"]
        return [subprocess.Popen([*mpirun, *command], env=environment(**MPI), **pipes)]
    about = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": free_port(), "WORLD_SIZE": str(size)}
    about |= {"LOCAL_WORLD_SIZE": str(size)}
    if engine == "nccl":
        command.append("nccl")
        about["CUDA_VISIBLE_DEVICES"] = os.environ.get(
            "CUDA_VISIBLE_DEVICES", ",".join(map(str, range(size)))
        )
    return [
        subprocess.Popen(
            command, env=environment(**about, RANK=str(rank), LOCAL_RANK=str(rank)), **pipes
        )
        for rank in range(size)
    ]


def run(engine, size, program, *arguments, limit=60):
    """Runs a program on ranks; gives exit codes and all output.

    A rank that fails ends the others, as torchrun does it.
    """
    with tempfile.TemporaryFile("w+") as file:
        processes = start(engine, size, program, *arguments, stdout=file)
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


@functools.cache
def results(engine, size, program):
    """The facts that a program of checks printed as JSON, by name of the check."""
    codes, output = run(engine, size, FOLDER / program, limit=280)
    found = {}
    for line in output.splitlines():
        if line.startswith("{"):
            found.update(json.loads(line))
    assert not any(codes), output[-4000:]
    return found
