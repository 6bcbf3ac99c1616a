"""Verbose output of a first launch on a GPU: its times against a clock around the launch."""

import pytest

import programs

PROGRAM = """
import ctypes, os, sys, threading, time
import warp as wp
driver = ctypes.CDLL(os.environ["WARP_CUDA_DRIVER"])

@wp.kernel(module="unique")
def before(x: wp.array(dtype=float)):
    x[wp.tid()] *= 3.0

@wp.kernel(module="unique")
def scale(x: wp.array(dtype=float)):
    x[wp.tid()] *= 2.0

wp.config.verbose = True
x = wp.zeros(100, dtype=float, device="cuda:0")
wp.launch(before, 100, [x], device="cuda:0")
wp.synchronize()
driver.fakeCudaSetGate(ctypes.c_bool(False))
threading.Timer(1.5, lambda: driver.fakeCudaSetGate(ctypes.c_bool(True))).start()
begin = time.perf_counter()
wp.launch(scale, 100, [x], device="cuda:0")
print(1000.0 * (time.perf_counter() - begin))
"""


def test_all_time_of_a_first_launch_has_a_name(tmp_path):
    """A driver that takes a second or more: the time is that of `load`, and little has no name."""
    if not programs.FAKE_CUDA.exists():
        pytest.skip("needs the driver that the unit tests are built with")
    environment = {"WARP_CACHE_PATH": tmp_path, "WARP_CUDA_DRIVER": programs.FAKE_CUDA}
    status, out, err = programs.run(programs.write_program(PROGRAM), **environment)
    assert status == 0, err
    wall = float(out)
    line = next(line for line in err.splitlines() if line.startswith("kernel 'scale': "))
    words = line.removeprefix("kernel 'scale': ").removesuffix(" ms").split(", ")
    times = {name: float(value) for name, value in (word.rsplit(" ", 1) for word in words)}
    # The timer starts before the launch does.
    assert 500.0 < times["load"] <= times["in all"] <= wall + 0.1
    assert wall - times["in all"] < 0.1 * wall
    assert times["other"] < 0.1 * wall
    phases = {name: value for name, value in times.items() if "/" not in name and name != "in all"}
    assert abs(sum(phases.values()) - times["in all"]) <= 0.1 * (len(phases) + 1)
