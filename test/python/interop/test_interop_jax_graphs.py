"""JAX: kernels and functions that it records in CUDA graphs of its own."""

import os
import subprocess
import sys

import pytest

import warp as wp

pytest.importorskip("jax")

PROGRAM = """
import jax, numpy as np, warp as wp

@wp.kernel
def scale(x: wp.array(dtype=float), s: float, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = s * x[i]

@wp.kernel
def totals(x: wp.array2d(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    wp.tile_store(y, wp.tile_sum(wp.tile_load(x[i], 64)), offset=i)

seen = {"JAX": [], "NONE": []}

def make(mode):
    def twice(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        seen[mode].append(wp.get_stream().is_capturing)
        between = wp.empty_like(x)
        wp.launch(scale, x.shape, [x, 2.0], [between])
        wp.launch(scale, x.shape, [between, 2.0], [y])
    return wp.jax_callable(twice, graph_mode=wp.JaxCallableGraphMode[mode])

def waits(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    wp.launch(scale, x.shape, [x, 1.0], [y])
    wp.synchronize_device()

@jax.jit
def program(x):
    y = wp.jax_kernel(scale)(x, 3.0)[0]
    y = make("JAX")(y + 1.0)[0]
    y = wp.jax_kernel(scale)(y, 0.5)[0]
    return make("NONE")(y)[0]

x = np.arange(640, dtype=np.float32)
given = [jax.device_put(x + shift) for shift in (0, 5)]
# What JAX compiles in between would take the graph away from the program.
for number in range(24):
    shift = 5 * (number // 12)
    y = np.asarray(program(given[number // 12]))
    assert np.array_equal(y, 8.0 * (3.0 * (x + shift) + 1.0)), number
assert any(seen["JAX"]), "JAX has recorded nothing"
assert len(seen["JAX"]) < 24, "JAX calls the function each time"
assert not any(seen["NONE"]) and len(seen["NONE"]) == 24

rows = wp.jax_kernel(totals, launch_dims=(10, 64), output_dims=10, block_dim=64)
sums = jax.jit(lambda x: make("JAX")(rows(x)[0] + 1.0)[0])
grid = x.reshape(10, 64)
moved = [jax.device_put(grid + shift) for shift in range(8)]
for shift, one in enumerate(moved):
    assert np.array_equal(np.asarray(sums(one)), 4 * ((grid + shift).sum(1) + 1))

waiting = jax.jit(lambda x: wp.jax_callable(waits)(wp.jax_kernel(scale)(x, 1.0)[0])[0])
try:
    for _ in range(8):
        waiting(given[0]).block_until_ready()
except Exception as error:
    assert "cannot wait for" in str(error), error
    print("waiting is refused")
print("recorded")
"""


@pytest.mark.skipif(not wp.is_cuda_available(), reason="needs a CUDA device")
def test_graphs_of_jax(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    environment = {
        **os.environ,
        "JAX_PLATFORMS": "cuda",
        "XLA_FLAGS": "--xla_gpu_graph_min_graph_size=1",
        "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
    }
    done = subprocess.run(
        [sys.executable, str(program)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        timeout=300,
    )
    assert "recorded" in done.stdout, done.stderr
    assert "waiting is refused" in done.stdout
