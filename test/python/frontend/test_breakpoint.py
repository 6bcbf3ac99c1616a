"""`breakpoint()` in kernels."""

import signal
import subprocess
import sys

import pytest

from warp._src.kernels import native_code

PROGRAM = """
import sys, numpy as np, warp as wp

@wp.kernel
def doubled(x: wp.array(dtype=float), limit: float):
    i = wp.tid()
    if x[i] > limit:
        breakpoint()
    x[i] = 2.0 * x[i]

count = int(sys.argv[2])
x = wp.array(np.arange(float(count)), dtype=float, device="cpu")
wp.launch(doubled, count, [x, float(sys.argv[1])], device="cpu")
assert np.array_equal(x.numpy(), 2.0 * np.arange(count))
print("ended")
"""


@pytest.mark.skipif(not native_code.compiler(), reason="no Clang")
def test_only_threads_that_reach_it_stop(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    # Another size of launch needs other code, in a process that finds what the first has left.
    for limit, count, code, words in (
        ("100", "40", 0, "ended\n"),
        ("38.5", "40", -signal.SIGTRAP, ""),
        ("100", "4", 0, "ended\n"),
    ):
        done = subprocess.run(
            [sys.executable, program, limit, count], capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stdout) == (code, words), done.stderr
