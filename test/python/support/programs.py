"""Run whole programs in child processes: for crashes, caches and printed output."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import warp as wp

# The driver that the unit tests are built with, which stands for that of CUDA.
FAKE_CUDA = Path(wp.__file__).parents[2] / "test" / "unit" / "libwarp-fake-cuda.so"


def write_program(text, **values):
    """A file that holds `text`, with each `{name}` of `values` replaced."""
    for name, value in values.items():
        text = text.replace("{" + name + "}", str(value))
    path = Path(tempfile.mkdtemp(prefix="warp-test-program-")) / "program.py"
    path.write_text(text)
    return path


def start(path, *arguments, **environment):
    """Start a program; a Popen with text pipes.

    Machine code of a real `ptxas` is nothing for the driver of the unit tests.
    """
    if environment.get("WARP_CUDA_DRIVER") == FAKE_CUDA:
        environment = {"WARP_PTXAS": "none"} | environment
    return subprocess.Popen(
        [sys.executable, str(path), *map(str, arguments)],
        env=os.environ | {name: str(value) for name, value in environment.items()},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(path, *arguments, timeout=120, **environment):
    """Run a program to its end; (exit status, stdout, stderr). A signal is a negative status."""
    process = start(path, *arguments, **environment)
    try:
        out, err = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise
    return process.returncode, out, err
