"""Threads that launch while the process exits or forks."""

import subprocess
import sys

import pytest

HEAD = """
import os, sys, threading, time
import warp as wp

@wp.kernel
def fill(x: wp.array(dtype=float)):
    x[wp.tid()] = 1.0

def run():
    x = wp.zeros(100000, device="cpu")
    wp.launch(fill, 100000, inputs=[x], device="cpu")
    return x.numpy().sum()
"""

EXIT = """
run()
def always():
    while True:
        run()
for _ in range(3):
    threading.Thread(target=always, daemon=True).start()
time.sleep(0.2)
print("done")
"""

FORK = """
threading.Thread(target=run).start()
time.sleep(float(sys.argv[1]))
child = os.fork()
if child == 0:
    os._exit(0 if run() == 100000.0 else 1)
print("status", os.waitpid(child, 0)[1])
"""


def python(source, *arguments):
    made = subprocess.run(
        [sys.executable, "-c", _as_file(source), *arguments],
        capture_output=True,
        text=True,
        timeout=30,
    )
    return made.returncode, made.stdout.strip(), made.stderr


def _as_file(source):
    """Kernels need a file with their source, which `-c` is not."""
    return (
        "import sys, tempfile, runpy, os\n"
        "path = os.path.join(tempfile.mkdtemp(), 'program.py')\n"
        f"open(path, 'w').write({HEAD + source!r})\n"
        "runpy.run_path(path, run_name='__main__')\n"
    )


def test_exit_while_daemon_threads_launch():
    for _ in range(3):
        status, output, log = python(EXIT)
        assert (status, output) == (0, "done"), log


@pytest.mark.parametrize("delay", ["0.001", "0.02", "0.05", "0.15"])
def test_fork_while_another_thread_makes_the_first_launch(delay):
    status, output, log = python(FORK, delay)
    assert (status, output) == (0, "status 0"), log
