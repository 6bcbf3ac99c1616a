"""Machine code that is kept for one version of the driver is absent for another."""

import pytest

import programs

PROGRAM = programs.write_program("""
import ctypes, os
import warp as wp
from warp import _native
wp.config.quiet = True
driver = ctypes.CDLL(os.environ["WARP_CUDA_DRIVER"])

@wp.kernel
def scale(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = x[i] * 2.0

x = wp.zeros(100, dtype=float, device="cuda:0")
wp.synchronize()
before = driver.fakeCudaAssemblies()
wp.launch(scale, 100, [x], device="cuda:0")
wp.synchronize()
was_assembled = driver.fakeCudaAssemblies() != before
# Threads of low priority leave the machine code for later processes.
_native.wait_for_background()
print(was_assembled)
""")


def test_driver_update(tmp_path):
    """Each version has the code assembled once, and finds its own again afterwards."""
    if not programs.FAKE_CUDA.exists():
        pytest.skip("needs the driver that the unit tests are built with")
    found = []
    for version in (12080, 12080, 13000, 13000, 12080):
        status, out, err = programs.run(
            PROGRAM,
            WARP_CACHE_PATH=tmp_path / "cache",
            WARP_CUDA_DRIVER=programs.FAKE_CUDA,
            FAKE_CUDA_VERSION=version,
        )
        assert status == 0, err
        found.append(out.strip())
    assert found == ["True", "False", "True", "False", "False"]
